// SPDX-License-Identifier: GPL-3.0-or-later
// Handles and the solve that follows them: deform; train_inverse for the field it makes.
#pragma once

#include "energies/handles.h"
#include "solve/deform.h"
#include "solve/hooks.h"
#include "solve/trained/inverse_training.h"
