// SPDX-License-Identifier: GPL-3.0-or-later
// deform and stylize over a radial field: a RadialSolver, run to convergence in one call.
#pragma once

#include <functional>

#include "energies/style.h"
#include "fields/handle_blend.h"
#include "options/deform.h"
#include "options/stylize.h"
#include "solve/hooks.h"
#include "solve/report.h"

namespace arapfields {

/// Exact handles (fields/handle_blend.h), and the field that they make of a radial one.
struct ExactHandles {
  std::shared_ptr<const HandleBlend> blend;
  std::function<std::shared_ptr<DeformationField>(std::shared_ptr<const DeformationField>)> around;
};

/// As deform (solve/deform.h) for options.field "radial". `iterations` bounds the quasi-Newton steps; options
/// of networks have no effect. Handles are soft, unless `exact` is given.
Solution deform_radial(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                       const DeformOptions& options, const Progress& progress, const SolveHooks& hooks = {},
                       const ExactHandles* exact = nullptr);

/// Options of a solve whose soft handles are stiff enough that a blend with exact ones bends it little.
DeformOptions followed_closely(DeformOptions options);

/// The start for a network: deform_radial's field after some tens of iterations, whatever options.field is.
/// Handles are soft; the network's own blend makes them exact.
std::shared_ptr<const DeformationField> radial_start(const SurfaceSamples& samples,
                                                     const std::vector<Handle>& handles,
                                                     DeformOptions options, const Progress& progress);

/// As stylize (solve/stylize.h) for options.field "radial".
Solution stylize_radial(const SurfaceSamples& samples, const Style& style, const StylizeOptions& options,
                        const Progress& progress, const Vector& weights, const std::vector<Handle>& handles,
                        const Vec3& up, const SolveHooks& hooks = {});

}  // namespace arapfields
