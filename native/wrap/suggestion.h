// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "wrap/wrap.h"

namespace arapfields {

/// At most `count` pairs of landmarks for a wrap, in mesh coordinates: ends of the surface, which are
/// farthest from each other inside the shape, and where a coarse wrap without landmarks takes them. An end
/// that comes near an end of the target goes there. Throws as wrap() does, and InvalidInput for a count
/// below 1.
ARAPFIELDS_EXPORT std::vector<Landmark> suggest_landmarks(const SurfaceSamples& samples,
                                                          const ImplicitFunction& target, int count,
                                                          const WrapOptions& options,
                                                          const Progress& progress = {});

}  // namespace arapfields
