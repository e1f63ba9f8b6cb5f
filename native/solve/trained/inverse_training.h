// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "mesh/surface_samples.h"
#include "options/inverse.h"
#include "solve/solution.h"

namespace arapfields {

/// A network g ≈ f⁻¹, trained on the cycle ‖f(g(y)) − y‖² at deformed samples and at uniform points of their
/// box (enlarged by a tenth), and at the samples x on ‖g(f(x)) − x‖² too, which decides where f has several
/// preimages. Its report's energy is that mean square cycle error; the frame is f's.
ARAPFIELDS_EXPORT Solution train_inverse(const DeformationField& field, const SurfaceSamples& samples,
                                         const InverseTrainingOptions& options,
                                         const Progress& progress = {});

}  // namespace arapfields
