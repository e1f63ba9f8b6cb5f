// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solve/radial/state.h"

namespace arapfields {

/// Adds to each handle's motion the least translation that brings the points it holds to the feasible side of
/// the contact planes. Returns for each handle the surface with the largest multiplier; −1: none.
std::vector<Index> hold_back(RadialState& state, std::vector<Mat4>& motions);
/// How far handles are pulled with self-contact: to their targets, or a short way at a time, those that it
/// holds back or all.
enum class Pull { full, short_where_held, short_for_all };
/// Sets the targets of the handles' springs to `motions`, held back by contact. Returns the surfaces of
/// hold_back().
std::vector<Index> set_reachable_targets(RadialState& state, std::vector<Mat4> motions,
                                         Pull pull = Pull::short_where_held);
/// The handles that contact keeps from their targets, and the surface that does it: of hold_back() (`by`), or
/// the one that presses most.
std::vector<HeldBack> held_back_handles(RadialState& state, const std::vector<Index>& by);

}  // namespace arapfields
