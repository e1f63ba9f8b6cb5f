// SPDX-License-Identifier: GPL-3.0-or-later
// Uniform samples of an implicit surface: sample_surface.
#pragma once

#include "sampling/sample_surface.h"
