// SPDX-License-Identifier: GPL-3.0-or-later
// Deformation at interactive rates: LiveSolver.
#pragma once

#include "solve/live_solver.h"
