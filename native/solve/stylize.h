// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "energies/handles.h"
#include "energies/style.h"
#include "mesh/surface_samples.h"
#include "options/stylize.h"
#include "solve/hooks.h"
#include "solve/solution.h"

namespace arapfields {

/// Deforms a surface so that its normals turn to preferred ones, or to an object's, as rigidly as possible:
///   share·gauss_weight·style + rigidity·(stretch + bending·bend) + keep_stance·stance +
///   handles,
/// share 1 of a style alone, whose field goes the strength's share of its way from rest; else that of the
/// strength (StyleAtSamples). ñ are the deformed surface's unit normals, style the mean of u(1 − g(ñ)), or of
/// 3 u‖ñ − T(n)‖². (In the paper its sign is reversed, and ñ has no unit length: a collapsing surface would
/// win.) Without handles the lowest sample, against `up`, keeps its height, the middle its place; with them
/// there is no stance. `weights` (one u ≥ 0 a sample, or empty) blend the effect. Strength 0 is the identity,
/// and so is a sphere's style. External energies may depend on where the surface is: with them, a spring
/// alone holds the lowest sample. An observer gets deform's terms, style and stance. Throws InvalidInput for
/// bad options, samples without normals, weights or handles that do not fit; SolveDiverged; Cancelled.
ARAPFIELDS_EXPORT Solution stylize(const SurfaceSamples& samples, const Style& style,
                                   const StylizeOptions& options, const Progress& progress = {},
                                   const Vector& weights = {}, const std::vector<Handle>& handles = {},
                                   const Vec3& up = Vec3::UnitZ(), const SolveHooks& hooks = {});

}  // namespace arapfields
