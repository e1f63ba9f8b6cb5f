// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solve/radial/state.h"

namespace arapfields {

/// The handles pull towards where these motions take them, as far as contact lets them; `gently`: what the
/// shape itself holds back does not pull from far.
void set_reachable_targets(RadialState& state, std::vector<Mat4> motions, bool gently = true);
/// Which handles are kept from their targets, and by which surface.
std::vector<HeldBack> held_back_handles(RadialState& state);

}  // namespace arapfields
