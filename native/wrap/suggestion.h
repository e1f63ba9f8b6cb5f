// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "wrap/wrap.h"

namespace arapfields {

/// At most `count` pairs of landmarks for a wrap, in mesh coordinates: extremities of the surface, by
/// farthest points in interior distance, and their images under a coarse wrap without landmarks, or the
/// target's extremity next to those. Throws as wrap() does, and InvalidInput for a count below 1.
ARAPFIELDS_EXPORT std::vector<Landmark> suggest_landmarks(const SurfaceSamples& samples,
                                                          const ImplicitFunction& target, int count,
                                                          const WrapOptions& options,
                                                          const Progress& progress = {});

}  // namespace arapfields
