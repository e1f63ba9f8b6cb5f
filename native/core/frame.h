// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Radius of gyration of a surface in its cube: that of an animal whose half-extent is about 0.75.
constexpr double gyration_in_cube = 0.6;

/// Mesh coordinates ↔ the unit cube [-1,1]³ in which networks live: x_cube = (x_mesh − center) / scale.
struct ARAPFIELDS_EXPORT Frame {
  Vec3 center = Vec3::Zero();
  double scale = 1.0;

  /// Centres the points' bounding box and scales its largest half-extent to `half_extent`.
  /// Throws InvalidInput for no points, non-finite ones, or all of them equal.
  static Frame around(PointsIn points, double half_extent = 0.75);

  /// Centres patches of a surface, given by their centroids (n,3), areas (n, none negative) and mean squared
  /// distances to their centroids (n), at the centroid of the area, and scales its radius of gyration to
  /// `gyration_radius`. Neither depends on axes, and what is small and far away hardly moves them: patches
  /// beyond three radii count as if they were at that distance (Huber's M-estimate).
  /// Throws InvalidInput for no patches, non-finite numbers, no area, or all of it in one point.
  static Frame balanced(PointsIn centroids, const Vector& areas, const Vector& spreads = {},
                        double gyration_radius = gyration_in_cube);

  Points to_cube(PointsIn points) const;
  Points to_mesh(PointsIn points) const;
  /// A rigid motion or box matrix (4×4, affine) of mesh coordinates, in cube coordinates on both sides.
  Mat4 motion_to_cube(const Mat4& motion) const;
  /// A matrix whose columns span a box in mesh coordinates (domain untouched), in cube coordinates.
  Mat4 placement_to_cube(const Mat4& placement) const;
  bool operator==(const Frame&) const = default;
};

}  // namespace arapfields
