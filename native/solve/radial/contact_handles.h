// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solve/radial/state.h"

namespace arapfields {

/// Adds to each handle's motion the least translation that brings the points it holds to the feasible side of
/// the contact planes. Returns for each handle the surface with the largest multiplier; −1: none.
std::vector<Index> hold_back(RadialState& state, std::vector<Mat4>& motions);
/// Sets the targets of the handles' springs to `motions`, held back by contact. `gently`: a handle that
/// self-contact holds back gets a target near its current position instead.
void set_reachable_targets(RadialState& state, std::vector<Mat4> motions, bool gently = true);
/// The handles that contact keeps from their targets, and the surface that does it.
std::vector<HeldBack> held_back_handles(RadialState& state);

}  // namespace arapfields
