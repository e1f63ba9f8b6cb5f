// SPDX-License-Identifier: GPL-3.0-or-later
// Implicit functions: networks fitted to a mesh (fit_sdf, NeuralSdf), and any function of one's own.
#pragma once

#include "core/implicit.h"
#include "extraction/batch_function.h"
#include "neural/fit.h"
#include "neural/neural_sdf.h"
#include "options/grid.h"
