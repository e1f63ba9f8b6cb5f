// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/implicit.h"
#include "core/task.h"
#include "mesh/surface_samples.h"
#include "options/sampling.h"

namespace arapfields {

/// Lines and evaluations of a call of sample_surface.
struct SampleReport {
  Index lines = 0;                 ///< lines cast
  Index value_evaluations = 0;     ///< points at which Φ alone was evaluated
  Index gradient_evaluations = 0;  ///< points at which Φ and ∇Φ were
  Index model_evaluations = 0;     ///< those among both that went into the sparse model
  double lipschitz = 0.0;          ///< bound on |∇Φ| that was measured
  double largest_value = 0.0;      ///< largest |Φ| of the points
  double seconds = 0.0;
};

/// Points distributed uniformly by area over {Φ = 0} in [-1,1]³, in random order, with normals ∇Φ/|∇Φ|: all
/// crossings of random lines (Ling et al. 2025, "Uniform sampling of surfaces by casting rays"), thinned to
/// `count` at random. Depends on the seed, not on the number of threads.
/// Throws InvalidInput for bad options, a function that is not finite, and a surface that no line crosses.
ARAPFIELDS_EXPORT SurfaceSamples sample_surface(const ImplicitFunction& function,
                                                const SampleOptions& options = {},
                                                const Progress& progress = {},
                                                SampleReport* report = nullptr);
/// The same; the samples keep the function, so that they can be redrawn (SurfaceSamples::redraw).
ARAPFIELDS_EXPORT SurfaceSamples sample_surface(const std::shared_ptr<const ImplicitFunction>& function,
                                                const SampleOptions& options = {},
                                                const Progress& progress = {},
                                                SampleReport* report = nullptr);

}  // namespace arapfields
