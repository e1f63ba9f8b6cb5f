// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/implicit.h"
#include "core/task.h"
#include "sampling/oriented_points.h"
#include "wrap/curvature.h"

namespace arapfields {

/// A similarity of space, x → scale · rotation · x + translation.
struct Similarity {
  double scale = 1.0;
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();

  Points of(PointsIn points) const;
  Points inverse_of(PointsIn points) const;
};

/// The target surface of a wrap: points (m,3) distributed evenly over it, in random order, with unit normals.
struct WrapTarget {
  Points points, normals;
  Vector interior;        ///< (m) mask: 1 in the interior of the surface, 0 at its border
  bool closed = true;     ///< whether the surface has no border
  double spacing = 0.0;   ///< mean distance of neighbouring points
  double diagonal = 0.0;  ///< of the bounding box
  OrientedPoints tree;
  SurfaceCurvature curvature;  ///< at the points; empty if it is not used

  /// The target in the coordinates that the similarity maps to the target's own.
  WrapTarget transformed_back(const Similarity& placement) const;
  /// The first `count` points, or all if there are fewer.
  WrapTarget subsample(Index count) const;
};

/// Samples a function's surface, in mesh coordinates: the triangles of a MeshSdf, which may be open or
/// broken, and the zero set of other functions. Throws InvalidInput that names `target` if there is no
/// surface.
WrapTarget wrap_target(const ImplicitFunction& function, Index count, std::uint64_t seed,
                       const Progress& progress);

/// The curvature of the function's surface at the points of a target that was sampled from it and then
/// transformed back by `placement`.
SurfaceCurvature curvature_of(const ImplicitFunction& function, const WrapTarget& target,
                              const Similarity& placement, std::uint64_t seed, const Progress& progress);

/// Mean distance of neighbours among points spread evenly over a surface.
double mean_spacing(PointsIn points);

/// Distances of samples to a surface, weighted by area: the mean and the 95 % quantile; 0 where there are
/// none.
struct SurfaceDistances {
  double mean = 0.0, quantile_95 = 0.0;
};

/// Distances of queries (n,3) to a surface given by points and normals: the normal component, and the
/// tangential one beyond the points' spacing. `areas` (n; empty: all 1) are the queries' weights. Queries
/// whose nearest point has `interior` 0 (empty: all 1) are skipped: at a border they have no counterpart.
SurfaceDistances surface_distances(const OrientedPoints& tree, PointsIn points, PointsIn normals,
                                   double spacing, PointsIn queries, PointsIn query_normals,
                                   const Vector& areas, const Vector& interior);

}  // namespace arapfields
