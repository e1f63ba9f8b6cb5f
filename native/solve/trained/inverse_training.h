// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "mesh/surface_samples.h"
#include "options/inverse.h"
#include "solve/solution.h"

namespace arapfields {

/// A network g ≈ f⁻¹, trained on the cycle error ‖f(g(y)) − y‖² at deformed samples and at uniform points of
/// their bounding box (enlarged by a tenth), and on ‖g(f(x)) − x‖² at the samples x, which selects one of
/// several preimages. The report's energy is the mean squared cycle error; the frame is f's.
ARAPFIELDS_EXPORT Solution train_inverse(const DeformationField& field, const SurfaceSamples& samples,
                                         const InverseTrainingOptions& options,
                                         const Progress& progress = {});

}  // namespace arapfields
