// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "solve/radial/state.h"

namespace arapfields {

/// Solves outside of the contact's obstacles. What a solve `freely`, in so many steps, does not bring near
/// any stays as that left it. Parts that overlap there are pushed apart. Where that does not do, and at
/// obstacles, the targets are approached in steps that no sample jumps through anything by.
void follow_in_contact(RadialState& state, Index iterations, double tolerance,
                       const std::function<void(Index)>& freely, const Progress& progress);

/// Where the places of the planes that were found are now.
Points contact_places(RadialState& state);
/// Takes motions of the handles back, each by the least translation after which all that the handle holds is
/// beyond the planes that were found. Returns which surface asks for the most of it; −1: none.
std::vector<Index> hold_back(RadialState& state, std::vector<Mat4>& motions);
/// The handles pull towards where these motions take them, as far as contact lets them; `gently`: what the
/// shape itself holds back does not pull from far.
void set_reachable_targets(RadialState& state, std::vector<Mat4> motions, bool gently = true);
/// The least motion, in the norm of the quasi-Newton model, that brings the surface beyond the planes that
/// were found.
void push_out(RadialState& state);
/// The preconditioner feels the planes that press on the current shape.
void stiffen_contact(RadialState& state);
/// Updates the pressures by the depths, scaled for each surface to what balances all other forces: before a
/// descent has ended, depths say little about forces.
void press_balanced(RadialState& state);
/// Updates the pressures by the depths. Returns how much of them has changed, 0 to 1.
double press_contact(RadialState& state);
bool would_press(RadialState& state);
/// Whether a place is deeper than solves leave it.
bool is_deep(RadialState& state);

}  // namespace arapfields
