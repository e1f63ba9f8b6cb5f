// SPDX-License-Identifier: GPL-3.0-or-later
// Uniform samples of an implicit surface: sample_surface; with_weights.
#pragma once

#include "sampling/sample_surface.h"
#include "sampling/sample_weights.h"
