// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solve/radial/state.h"

namespace arapfields {

/// Where the places of the planes that were found are now.
Points contact_places(RadialState& state);
/// The least motion, in the norm of the quasi-Newton model, that brings the surface beyond the planes that
/// were found.
void push_out(RadialState& state);
/// The preconditioner feels the planes that press on the current shape.
void stiffen_contact(RadialState& state);
/// Updates the pressures by the depths. Returns how much of them has changed, 0 to 1.
double press_contact(RadialState& state);
/// The same, scaled for each surface to what balances all other forces: before a descent has ended, depths
/// say little about forces.
void press_balanced(RadialState& state);
bool would_press(RadialState& state);
/// Whether a place is deeper than steps in time leave it.
bool is_deep(RadialState& state);

}  // namespace arapfields
