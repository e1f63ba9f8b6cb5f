// SPDX-License-Identifier: GPL-3.0-or-later
// Energies of callers, which join a solve.
#pragma once

#include <memory>
#include <vector>

#include "core/errors.h"
#include "core/jets.h"

namespace arapfields {

/// A caller's term of the loss of deform or stylize.
class ARAPFIELDS_EXPORT ExternalEnergy {
 public:
  virtual ~ExternalEnergy();
  /// The order of the jets that evaluate() needs: first or second.
  virtual JetOrder order() const { return JetOrder::first; }
  /// The value at rest points (n,3) of the unit cube at which the field has these jets, of order(); adds its
  /// derivatives by them to the cotangents, which are zero before. Called on the thread that called the
  /// solver; what it throws comes through.
  virtual double evaluate(PointsIn points, const JetView<const double>& jets,
                          const JetView<double>& cotangents) = 0;
};

using ExternalEnergies = std::vector<std::shared_ptr<ExternalEnergy>>;

/// The highest order among the energies and `own`.
JetOrder highest_order(const ExternalEnergies& energies, JetOrder own);

/// The energies' values times `weight`, one after the other; adds their derivatives times it to cotangents of
/// the same order as the jets (null data: values alone). Throws InvalidInput that names the energy
/// for a value that is NaN, and for derivatives that are not finite where the value is.
template <class Scalar>
std::vector<double> external_energies(const ExternalEnergies& energies, PointsIn points,
                                      const JetView<const Scalar>& jets, double weight,
                                      const JetView<Scalar>& cotangents);

}  // namespace arapfields
