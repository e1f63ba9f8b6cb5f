// SPDX-License-Identifier: GPL-3.0-or-later
// Checks and conversions of input that all solvers share.
#pragma once

#include "core/errors.h"
#include "core/task.h"
#include "energies/handles.h"
#include "mesh/sample_mesh.h"
#include "mesh/surface_samples.h"

namespace arapfields {

inline void require_samples(const SurfaceSamples& samples) {
  require(samples.size() > 0, "samples", "none were given", "at least one is needed");
  require(samples.points.allFinite(), "samples", "some are NaN or infinite", "all must be finite");
  require_weights("samples.weights", samples.weights, samples.size());
  require_weights("samples.bend_weights", samples.bend_weights, samples.size());
}

/// Throws InvalidInput that names the first handle with a reach: a style, say, moves the whole shape.
inline void require_no_reach(const std::vector<Handle>& handles, const std::string& why = "a style") {
  for (std::size_t i = 0; i < handles.size(); ++i)
    require(handles[i].reach == 0.0, "handles[" + std::to_string(i) + "].reach",
            number_text(handles[i].reach) + " beside " + why,
            "a reach is for radial fields that handles alone deform, without exact handles");
}

/// Handles of mesh coordinates in the frame's cube.
inline std::vector<Handle> in_cube(const std::vector<Handle>& handles, const Frame& frame) {
  std::vector<Handle> result;
  for (const Handle& handle : handles) result.push_back(handle.in_cube(frame));
  return result;
}

/// Handles of mesh coordinates, bound to samples in their cube.
inline BoundHandles bound_handles(const std::vector<Handle>& handles, const SurfaceSamples& samples) {
  return BoundHandles(in_cube(handles, samples.frame), samples.points);
}

}  // namespace arapfields
