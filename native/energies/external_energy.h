// SPDX-License-Identifier: GPL-3.0-or-later
// User-defined energies that are added to a solve's objective.
#pragma once

#include <memory>
#include <vector>

#include "core/errors.h"
#include "core/jets.h"

namespace arapfields {

class JetTerm;

/// A user-defined term of the loss of deform or stylize.
class ARAPFIELDS_EXPORT ExternalEnergy {
 public:
  virtual ~ExternalEnergy();
  /// The order of the jets that evaluate() needs: first or second.
  virtual JetOrder order() const { return JetOrder::first; }
  /// The value for rest points (n,3) of the unit cube and the field's jets there, of order(); adds its
  /// derivatives by the jets to the cotangents, which are zero before. Called on the thread that called the
  /// solver; exceptions are passed on.
  virtual double evaluate(PointsIn points, const JetView<const double>& jets,
                          const JetView<double>& cotangents) = 0;
};

using ExternalEnergies = std::vector<std::shared_ptr<ExternalEnergy>>;

/// The energies' values times `weight`, one after the other; adds their derivatives times it to cotangents of
/// the same order as the jets (null data: values alone). Throws InvalidInput that names the energy
/// for a value that is NaN, and for derivatives that are not finite where the value is.
template <class Scalar>
std::vector<double> external_energies(const ExternalEnergies& energies, PointsIn points,
                                      const JetView<const Scalar>& jets, double weight,
                                      const JetView<Scalar>& cotangents);

/// Energies times `weight` as one term, with a part "energies[i]" of each.
std::shared_ptr<JetTerm> external_term(ExternalEnergies energies, double weight);

}  // namespace arapfields
