// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/implicit.h"
#include "core/task.h"
#include "sampling/oriented_points.h"

namespace arapfields {

/// A similarity of space, x → scale · rotation · x + translation.
struct Similarity {
  double scale = 1.0;
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();
  Points of(PointsIn points) const;
  Points inverse_of(PointsIn points) const;
};

/// The surface that another is wrapped onto, as points (m,3) spread evenly over it with unit normals.
struct WrapTarget {
  Points points, normals;
  Vector whole;           ///< (m) 1 inside the surface, 0 beside a border where it ends
  bool closed = true;     ///< whether it ends nowhere
  double spacing = 0.0;   ///< about the distance of neighbouring points
  double diagonal = 0.0;  ///< of its bounding box
  OrientedPoints tree;

  /// The same where the similarity takes it from.
  WrapTarget seen_from(const Similarity& placement) const;
  /// So many of the points, or all where there are no more.
  WrapTarget thinned(Index count) const;
};

/// In mesh coordinates. A mesh's own triangles are sampled, so that it may be open and broken; other
/// functions where they are 0. Throws InvalidInput that names `target` where there is no surface.
WrapTarget wrap_target(const ImplicitFunction& function, Index count, std::uint64_t seed,
                       const Progress& progress);

/// About the distance of neighbours among points that are spread evenly over a surface.
double mean_spacing(PointsIn points);

/// Distances between surfaces: the mean, and what 95 % of an area keep; 0 where none was told.
struct SurfaceDistances {
  double mean = 0.0, most_95 = 0.0;
};

/// How far others (n,3) are from a surface of which there are points and normals: the way across it, and the
/// way along it beyond the spacing of its points. Each other stands for its area (a number each, or empty:
/// all for the same). Where `whole` (a number a point, or empty) is 0 nothing is told: what would be compared
/// with a border has no counterpart.
SurfaceDistances surface_distances(const OrientedPoints& tree, PointsIn points, PointsIn normals,
                                   double spacing, PointsIn others, PointsIn other_normals,
                                   const Vector& areas, const Vector& whole);

}  // namespace arapfields
