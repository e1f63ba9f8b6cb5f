// SPDX-License-Identifier: GPL-3.0-or-later
// What the solvers share.
#pragma once

#include "core/errors.h"
#include "core/stopwatch.h"
#include "energies/handles.h"
#include "mesh/surface_samples.h"

namespace arapfields {

inline void require_samples(const SurfaceSamples& samples) {
  require(samples.size() > 0, "samples", "none were given", "at least one is needed");
  require(samples.points.allFinite(), "samples", "some are NaN or infinite", "all must be finite");
}

/// Handles of mesh coordinates in the frame's cube.
inline std::vector<Handle> in_cube(const std::vector<Handle>& handles, const Frame& frame) {
  std::vector<Handle> result;
  for (const Handle& handle : handles) result.push_back(handle.in_cube(frame));
  return result;
}

}  // namespace arapfields
