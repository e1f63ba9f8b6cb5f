// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/task.h"
#include "mesh/surface_samples.h"

namespace arapfields {

/// What contact follows of a surface: samples, and vertices of its mesh that stand out of them.
struct FollowedPlaces {
  /// `order` lists the samples so that neighbours follow each other. Throws Cancelled.
  FollowedPlaces(const SurfaceSamples& surface, const std::vector<std::uint32_t>& order, std::uint64_t seed,
                 const Progress& progress);

  std::vector<Index> samples;  ///< rows of the surface's
  std::vector<Index> parents;  ///< of each vertex, the nearest of these
  Points rest;                 ///< (n,3) in the cube: the samples, then the vertices
  double spacing = 0.0;        ///< about the distance of a sample to what it stands for
};

}  // namespace arapfields
