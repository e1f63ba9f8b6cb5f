// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "core/task.h"
#include "core/types.h"
#include "distance/signed_distance.h"
#include "mesh/surface_samples.h"

namespace arapfields {

class LocalThickness;

struct BoundingBall {
  Vec3 center = Vec3::Zero();
  double radius = 0.0;

  /// The rows of points (n,3) inside.
  std::vector<Index> rows_inside(PointsIn points) const;
};

/// A region of a surface where parts of the shape that are thin for the spacing of samples lie beside each
/// other, such as a figure's hand with its fingers.
struct FineRegion {
  /// (n,3) samples of the region and its surroundings, uniform by area, denser than the others
  Points points;
  Points normals;     ///< (n,3) outward, unit length
  Vector shares;      ///< (n) how much each belongs to the region: 1 near the thin parts, 0 from its rim on
  BoundingBall ball;  ///< that contains the points
  std::shared_ptr<const SignedDistance> nearest_point;  ///< among the points
  double spacing = 0.0;                                 ///< of the points
  double size = 0.0;                                    ///< of the thin parts together

  FineRegion reflected(int axis) const;
  /// The rows of places (n,3) of the surface that are near its points; `nearest`: is given the nearest point
  /// of each.
  std::vector<Index> rows_on(PointsIn places, std::vector<std::int32_t>* nearest = nullptr) const;
  /// Shares of places (n,3) of the surface: those of the nearest points; 0 off the region.
  Vector shares_at(PointsIn places) const;
};

/// The fine regions of samples with normals on a mesh, for a spacing of nodes that is to resolve the shape;
/// none where the mesh is not known. Throws Cancelled.
std::vector<FineRegion> fine_regions(const SurfaceSamples& samples, const LocalThickness& thickness,
                                     double spacing, const Progress& progress);

}  // namespace arapfields
