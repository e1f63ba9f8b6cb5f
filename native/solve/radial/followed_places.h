// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/task.h"
#include "mesh/surface_samples.h"

namespace arapfields {

/// The contact points of a rest surface: a subset of its samples, and mesh vertices that stick out of them
/// (sampling/standing_out.h).
struct FollowedPlaces {
  /// `order` is a spatially coherent permutation of the samples. Throws Cancelled.
  FollowedPlaces(const SurfaceSamples& surface, const std::vector<std::uint32_t>& order, std::uint64_t seed,
                 const Progress& progress);

  std::vector<Index> samples;  ///< rows of the surface's samples
  std::vector<Index> parents;  ///< for each vertex the nearest entry of `samples`
  Points rest;                 ///< (n,3) cube coordinates: the samples, then the vertices
  double spacing = 0.0;        ///< mean sample spacing: square root of the area of a sample
};

}  // namespace arapfields
