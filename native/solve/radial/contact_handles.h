// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solve/radial/state.h"

namespace arapfields {

/// Takes motions of the handles back, each by the least translation after which all that the handle holds is
/// beyond the planes that were found. Returns which surface asks for the most of it; −1: none.
std::vector<Index> hold_back(RadialState& state, std::vector<Mat4>& motions);
/// The handles pull towards where these motions take them, as far as contact lets them; `gently`: what the
/// shape itself holds back does not pull from far.
void set_reachable_targets(RadialState& state, std::vector<Mat4> motions, bool gently = true);
/// Which handles are kept from their targets, and by which surface.
std::vector<HeldBack> held_back_handles(RadialState& state);

}  // namespace arapfields
