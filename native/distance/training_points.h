// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/frame.h"
#include "core/task.h"
#include "distance/signed_distance.h"
#include "mesh/triangle_mesh.h"
#include "options/points.h"

namespace arapfields {

/// Points of the cube with their exact signed distances; the near-surface ones come first.
struct TrainingPoints {
  PointsF points;          ///< (n,3), cube coordinates
  VectorF distances;       ///< (n), cube units, negative inside
  Index near_surface = 0;  ///< number of near-surface rows; fine and coarse offsets alternate
};

/// Displaced points that leave the cube are moved to its boundary. Point i depends on the seed and i alone.
/// Throws InvalidInput for options out of range, or a mesh without area.
TrainingPoints training_points(const SignedDistance& distance, const TriangleMesh& mesh, const Frame& frame,
                               const TrainingPointsOptions& options = {}, std::uint64_t seed = 0,
                               const Progress& progress = {});

}  // namespace arapfields
