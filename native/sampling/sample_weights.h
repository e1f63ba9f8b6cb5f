// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/surface_samples.h"

namespace arapfields {

/// The samples with a factor on each one's energy, and one on its bending (n each, ≥ 0; empty: all 1): bones,
/// armour, a face that must not stretch. Redrawn samples take the factors of the nearest of these samples.
/// Throws InvalidInput for another count, and for negative or non-finite numbers.
ARAPFIELDS_EXPORT SurfaceSamples with_weights(const SurfaceSamples& samples, const Vector& weights,
                                              const Vector& bend_weights = {});

}  // namespace arapfields
