// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "solve/radial/state.h"

namespace arapfields {

/// Solves outside of the contact's obstacles. What a solve `freely` does not bring near any stays as that
/// left it. Parts that overlap there are pushed apart. Where that does not do, and at obstacles, the targets
/// are approached in steps that no sample jumps through anything by.
void follow_in_contact(RadialState& state, Index iterations, double tolerance,
                       const std::function<void()>& freely, const Progress& progress);

/// The least motion, in the norm of the quasi-Newton model, that brings the surface beyond the planes that
/// were found.
void push_out(RadialState& state);
/// The preconditioner feels the planes that press on the current shape.
void stiffen_contact(RadialState& state);
/// The planes press on with what they press with now, but with no more than all other forces answer: what a
/// descent that has not ended leaves of a depth says little.
void press_as_answered(RadialState& state);
/// The planes press on with what they press with now. Returns how much of that has changed, 0 to 1.
double press_contact(RadialState& state);
bool would_press(RadialState& state);
/// Whether a place is deeper than solves leave it.
bool is_deep(RadialState& state);

}  // namespace arapfields
