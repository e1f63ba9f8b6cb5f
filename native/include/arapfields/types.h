// SPDX-License-Identifier: GPL-3.0-or-later
// Arrays, and the frame between mesh coordinates and the unit cube.
#pragma once

#include "core/frame.h"
#include "core/types.h"
