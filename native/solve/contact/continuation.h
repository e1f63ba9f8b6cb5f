// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "solve/radial/state.h"

namespace arapfields {

/// Solves without contact, in at most so many iterations.
using SolveFreely = std::function<void(Index)>;

/// A solve with contact constraints, from the shape and the targets of the last one: the handles are led to
/// their targets, and the obstacles to their placements.
void solve_in_contact(RadialState& state, Index iterations, double tolerance, const SolveFreely& freely,
                      const Progress& progress);

}  // namespace arapfields
