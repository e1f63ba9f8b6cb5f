// SPDX-License-Identifier: GPL-3.0-or-later
// What there is to compute with: devices and instruction sets.
#pragma once

#include "core/simd_level.h"
#include "tensors/device.h"
