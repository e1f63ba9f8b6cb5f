// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "energies/handles.h"
#include "mesh/surface_samples.h"
#include "options/deform.h"
#include "solve/hooks.h"
#include "solve/solution.h"

namespace arapfields {

/// Deforms a surface as rigidly as possible so that its handles (mesh coordinates) follow their motions.
/// Throws InvalidInput for bad options, no samples, no handles, or a handle that cannot be used (named),
/// SolveDiverged, Cancelled. An observer gets the weighted terms stretch, bend, barrier, locality,
/// handles, invertibility and energies[i], as far as the solve has them.
ARAPFIELDS_EXPORT Solution deform(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                                  const DeformOptions& options, const Progress& progress = {},
                                  const SolveHooks& hooks = {});

}  // namespace arapfields
