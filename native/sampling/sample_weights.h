// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/surface_samples.h"

namespace arapfields {

/// The samples with factors of their own on their energies, and on the bending in them: bones, armour, a face
/// that must not stretch. (n each, ≥ 0; empty: all 1); all 1 is the same as none. Samples that are drawn anew
/// take those of the nearest of these. Throws InvalidInput for other numbers of them.
ARAPFIELDS_EXPORT SurfaceSamples with_weights(const SurfaceSamples& samples, const Vector& weights,
                                              const Vector& bend_weights = {});

}  // namespace arapfields
