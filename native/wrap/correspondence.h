// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "wrap/target.h"

namespace arapfields {

/// Weights of the correspondences between a surface and a target.
struct CorrespondenceWeights {
  double weight = 1.0;      ///< of the mean squared distance
  double coverage = 1.0;    ///< of distances from the target's samples, relative to those from the surface's
  double normals = 0.3;     ///< of differences of unit normals, relative to distances in cube units
  double tangential = 0.1;  ///< of tangential distances, relative to normal ones
  double curvature = 0.0;   ///< of squared differences of curvatures, relative to their typical size
  double unoriented = 0.0;  ///< of distances to nearest points without regard to normals
};

/// Points of a surface in motion.
struct SurfacePoints {
  Points points, normals;  ///< (n,3), the normals of length 1
  Vector area_weights;     ///< (n) fraction of the surface's area that each point represents; their sum is 1
  RowMatrix<double> curvatures{};  ///< (n,2) as those of the target; empty where they are not compared
};

/// weight · (mean squared distance of the surface to its corresponding points + coverage · the same from the
/// target): for each point a quadratic form in its displacement v, vᵀ Q v − 2 rᵀ v + constant.
struct ARAPFIELDS_EXPORT_TO_TESTS CorrespondenceTerms {
  RowMatrix<double> forms;     ///< (n,6): xx, yy, zz, xy, xz, yz of each Q
  Points right_hand_sides;     ///< (n,3): each r = Q t, t the displacement onto the corresponding point
  Vector match_weights;        ///< (n) from 0, where a point has no counterpart, to 1
  double matched_share = 1.0;  ///< share of the surface's area that has a counterpart

  CorrespondenceTerms(const WrapTarget& target, const SurfacePoints& surface,
                      const CorrespondenceWeights& weights);
  /// Adds the tangential distances to places (n,3). The weight falls off with the distance from a place; it
  /// is a quarter at `distance`.
  void add_along(const SurfacePoints& surface, PointsIn places, double weight, double distance);

 private:
  void add_curvature(const WrapTarget& target, const SurfacePoints& surface,
                     const std::vector<Index>& target_of, double weight);
  void add_form(Index point, const Mat3& form, const Vec3& right_hand_side);
  void add(Index point, const Vec3& displacement, const Vec3& normal, double tangential, double weight);
};

}  // namespace arapfields
