// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels of radial fields, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Power κ of the bumps φ(s) = (1 − s/κ)₊^κ, s = |x − p|²/r²; they vanish at √κ radii.
constexpr int radial_power = 6;

/// One block of 16 points and the bumps it feels. Bumps are rows (center, 1/r²), coefficients rows of 3.
struct RadialBlock {
  const double* points;  // (3, 16)
  const double* bumps;
  const std::int32_t* active;
  std::int64_t active_count;
};

ARAPFIELDS_DECLARE(void radial_forward(const RadialBlock&, const double* coefficients, int columns,
                                       double* jets))
ARAPFIELDS_DECLARE(void radial_backward(const RadialBlock&, const double* cotangents, int columns,
                                        double* gradient))
ARAPFIELDS_DECLARE(void radial_rows(const RadialBlock&, int columns, double* rows))
ARAPFIELDS_DECLARE(std::int64_t radial_active(const double* center, double reach, const double* bumps,
                                              std::int64_t count, std::int32_t* active))
ARAPFIELDS_DECLARE(double farthest_update(const double* points, std::int64_t stride, std::int64_t count,
                                          const double* from, double* distance))

/// Gradient accumulators of radial_backward: (m, 3, radial_lanes) sums, one for each vector lane.
constexpr int radial_lanes = 8;

}  // namespace arapfields
