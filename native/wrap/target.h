// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/implicit.h"
#include "core/task.h"
#include "mesh/triangle_mesh.h"
#include "sampling/oriented_points.h"

namespace arapfields {

/// Curvature of a surface at n points, times a radius: the mean of the principal curvatures, and half of
/// their difference. It identifies places that distances cannot, along which a surface slides on another.
struct SurfaceCurvature {
  double radius = 0.0;          ///< of the fits
  RowMatrix<double> values;     ///< (n,2)
  RowMatrix<double> gradients;  ///< (n,6): of each value, along the surface
};

/// The two values (n,2) at places with unit normals (n,3), by weighted fits of quadrics to those points of a
/// surface that lie within twice the radius and face the same side. Source: Cazals, Pouget 2005, "Estimating
/// Differential Quantities Using Polynomial Fitting of Osculating Jets", section 3. Throws Cancelled.
ARAPFIELDS_EXPORT_TO_TESTS RowMatrix<double> curvature_values(PointsIn points, PointsIn normals,
                                                              PointsIn places, PointsIn place_normals,
                                                              double radius, const Progress& progress);

/// The values at the same kind of places with their gradients, by linear fits within the radius to the values
/// at the points.
ARAPFIELDS_EXPORT_TO_TESTS SurfaceCurvature curvature_at(PointsIn points, PointsIn normals, PointsIn places,
                                                         PointsIn place_normals, double radius,
                                                         const Progress& progress);

/// Standard deviation of a scan's vertex noise (independent displacements along the normals), in mesh units.
/// 0 with too few vertices, and where noise cannot be separated from the shape: on clean and on coarse
/// meshes. Estimated by the covariance of neighbours' Laplacians, which noise makes negative and a smooth
/// surface positive; the shape's part follows from the difference of the estimates by first and second
/// Laplacians.
double vertex_noise(const TriangleMesh& mesh);

/// The vertices (n,3) smoothed without shrinking, by as much as they are noisy; the mesh's own without noise,
/// or if smoothing would move them farther than the noise. Source: Taubin 1995, "A Signal Processing Approach
/// to Fair Surface Design".
Points without_noise(const TriangleMesh& mesh);

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
