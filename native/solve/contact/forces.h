// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solve/radial/state.h"

namespace arapfields {

/// Current positions (n,3) of the contact set's points.
Points contact_places(RadialState& state);
/// Projects the shape onto the feasible side of the contact planes: the least step in the norm of the
/// quasi-Newton model's Hessian.
void push_out(RadialState& state);
/// Adds the Hessian of the active contact planes to the preconditioner.
void stiffen_contact(RadialState& state);
/// Augmented-Lagrangian update of the pressures (multipliers) by the gaps. Returns their relative change, 0
/// to 1.
double update_pressures(RadialState& state);
/// The same, with each surface's pressures scaled by a factor in [0, 1] that best balances all other forces:
/// before a descent has converged, gaps times stiffness are no forces.
void update_balanced_pressures(RadialState& state);
/// Whether any plane is active: its updated pressure would be above 0.
bool would_press(RadialState& state);
/// Whether a point penetrates deeper than a time step may leave it.
bool is_deep(RadialState& state);

}  // namespace arapfields
