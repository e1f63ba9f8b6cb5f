// SPDX-License-Identifier: GPL-3.0-or-later
// Blending of frames, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Floats of one frame's motion: growth · rotation − 1 by columns, offset, shift, growth − 1.
constexpr int frame_length = 16;

// sums (count, 16) ← for each point the weighted sum of its frames' rows. Point i has the entries
// start[i] … start[i+1]−1 of `frames` and `weights`.
ARAPFIELDS_DECLARE(void blend_frames(const float* rows, const std::int64_t* start,
                                     const std::uint16_t* frames, const float* weights, std::int64_t count,
                                     float* sums))

}  // namespace arapfields
