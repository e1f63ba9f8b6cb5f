// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/frame.h"
#include "core/task.h"
#include "distance/signed_distance.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// How many points a neural distance function learns from, and where. Lengths are in cube units.
struct TrainingPointsOptions {
  Index near_surface = 200000;  ///< area-uniform points of the mesh, displaced; half with each spread
  Index in_volume = 50000;      ///< uniform in [-1,1]³
  double fine_spread = 0.01;    ///< standard deviation of the displacement's components
  double coarse_spread = 0.05;
  std::uint64_t seed = 0;
};

/// Points of the cube with their exact signed distances; the near-surface ones come first.
struct TrainingPoints {
  PointsF points;          ///< (n,3), cube coordinates
  VectorF distances;       ///< (n), cube units, negative inside
  Index near_surface = 0;  ///< so many rows at the front; fine and coarse spreads take turns
};

/// Displaced points that leave the cube are moved to its boundary. Point i depends on the seed and i alone.
/// Throws InvalidInput for negative counts, spreads that are not positive, or a mesh without area.
TrainingPoints training_points(const SignedDistance& distance, const TriangleMesh& mesh, const Frame& frame,
                               const TrainingPointsOptions& options = {}, const Progress& progress = {});

}  // namespace arapfields
