// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "energies/external_energy.h"
#include "solve/wrap_target.h"

namespace arapfields {

/// How a target draws a surface.
struct WrapPull {
  double weight = 1.0;    ///< of the mean squared distance
  double coverage = 1.0;  ///< of the distances from the target's side beside those from the surface's
  double turn = 0.3;      ///< what normals count in what belongs to what, beside cube units
  double slack = 0.1;     ///< share of ways along the target in the squared distances
  double contact = 1.0;   ///< weight, beside those, of sheets that have passed through each other
};

/// weight · (mean of squared distances from the samples to what belongs to them on the target, and coverage ·
/// the same from the target), with what belongs to what found at a given shape: a quadratic form of the
/// samples' places.
class WrapTerms final : public ExternalEnergy {
 public:
  /// Samples (n,3) at rest and their unit normals (n,3).
  WrapTerms(const WrapTarget& target, PointsIn rest, PointsIn normals)
      : target_(target), rest_(rest), rest_normals_(normals) {}
  JetOrder order() const override { return JetOrder::value; }
  double evaluate(PointsIn points, const JetView<const double>& jets,
                  const JetView<double>& cotangents) override;

  /// Finds what belongs to what for samples that have come to `places` (n,3) with unit normals (n,3).
  void match(PointsIn places, PointsIn normals, const WrapPull& pull);
  /// Share of the samples that something on the target belongs to.
  double matched_share() const { return matched_share_; }
  /// (n) between 0, where nothing does, and 1.
  const Vector& agreements() const { return agreements_; }
  /// Share of them that have passed through another sheet of the surface.
  double crossed_share() const { return crossed_share_; }

 private:
  void add(Index sample, const Vec3& to, const Vec3& normal, double slack, double weight);
  void keep_apart(const OrientedPoints& surface, PointsIn places, PointsIn normals, double weight);

  const WrapTarget& target_;
  Points rest_, rest_normals_;
  RowMatrix<double> forms_;  // (n,6): the quadratic form of each sample
  Points linear_;            // (n,3): its linear part, times −1/2
  Vector agreements_;
  double constant_ = 0.0, matched_share_ = 1.0, crossed_share_ = 0.0;
};

}  // namespace arapfields
