// SPDX-License-Identifier: GPL-3.0-or-later
// Deformation at interactive rates: RadialSolver.
#pragma once

#include "solve/radial/radial_solver.h"
