// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "energies/arap.h"
#include "energies/gauss.h"
#include "energies/handles.h"
#include "fields/radial_basis.h"
#include "solve/quasi_newton.h"

namespace arapfields {

/// A style's preference at the samples of a live solve.
struct LiveStyle {
  GaussPreference preference;
  Points normals;         ///< (n,3) rest normals of the samples
  Vector sample_weights;  ///< (n) or empty: all 1
  double weight = 1.0;    ///< λ_Gauss
};

/// What the terms of the energy come to.
struct LiveTerms {
  ArapValue arap;
  double handles = 0.0;  ///< mean squared distance to the targets
  double gauss = 0.0;    ///< mean(1 − g), where there is a style
};

/// stretch + λ_bend·bend + weight·handles + λ_Gauss·gauss + a vanishing pull of all bumps towards zero, of
/// the fields of one radial basis. Measurements: jets at the samples, values at the handles' sources, bumps.
class LiveObjective : public MeasuredObjective {
 public:
  LiveObjective(const RadialBasis& basis, PointsIn samples, double bending, double handle_weight);

  /// Replaces the handles (all cube coordinates) and refactors the preconditioner.
  void set_handles(HandleBatch<double> pairs);
  /// New targets for the pairs in place.
  void set_targets(Points targets);
  void set_style(std::optional<LiveStyle> style);

  LiveTerms terms(const Vector& u) const { return evaluate(u, nullptr); }
  /// Weighted mean and largest distance of the pairs from their targets.
  HandleError handle_distance(const Vector& u) const;
  JetView<const double> jets(const Vector& u) const { return {u.data(), samples_.size(), JetOrder::second}; }

  void measure(const RowMatrix<double>& c, Vector& u) const override;
  double value(const Vector& u, Vector* cotangents) const override;
  RowMatrix<double> pull_back(const Vector& cotangents) const override;
  RowMatrix<double> precondition(const RowMatrix<double>& gradient) const override;

 private:
  LiveTerms evaluate(const Vector& u, Vector* cotangents) const;
  Index handle_offset() const { return 30 * samples_.size(); }
  Index bump_offset() const { return handle_offset() + 3 * pairs_.sources.rows(); }

  Index bumps_;
  double bending_, handle_weight_;
  RadialSites samples_;
  RowMatrix<double> stiffness_;  // the surface's part of the preconditioner's matrix
  HandleBatch<double> pairs_;
  RowMatrix<double> handle_basis_;  // (pairs, size)
  RowMatrix<double> factor_;
  std::optional<LiveStyle> style_;
  const RadialBasis basis_;
};

}  // namespace arapfields
