// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "fields/radial_basis.h"
#include "mesh/surface_samples.h"
#include "sampling/local_thickness.h"

namespace arapfields {

/// What a surface's samples tell solvers before any handle: found once, and shared by all that solve on them.
/// In the samples' cube.
struct RestShape {
  /// `interior`: whether ways through the interior are looked for; `axis`: 0, 1 or 2 where fields are to be
  /// symmetric across the plane on which that coordinate is 0. Throws InvalidInput for no samples and for NaN
  /// or infinity among them.
  RestShape(const SurfaceSamples& samples, bool interior, std::uint64_t seed, int axis = -1);

  std::vector<std::uint32_t> order;  ///< the samples, neighbours beside each other
  std::shared_ptr<const LocalThickness> thickness;
  Points sites;         ///< (n,3) samples that centers are chosen from; folded where there is an axis
  RadialLayout layout;  ///< how dense centers stand there, and what is below
  std::shared_ptr<const InteriorEmbedding> embedding;  ///< null where straight distances serve
};

}  // namespace arapfields
