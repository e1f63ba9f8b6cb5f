// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels of radial fields, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Power κ of the bumps φ(s) = (1 − s/κ)₊^κ, s = |x − p|²/r²; they vanish at √κ radii.
constexpr int radial_power = 6;

/// One block of 16 points and the bumps it feels. Bumps are rows (center, 1/r²), coefficients rows of 3.
template <class Scalar>
struct RadialBlock {
  const Scalar* points;  // (3, 16)
  const Scalar* bumps;
  const std::int32_t* active;
  std::int64_t active_count;
};

/// Lanes of the gradient's partial sums, (m, 3, radial_lanes).
constexpr int radial_lanes = 16;

// Jets (columns, 3, 16) of the bumps' part.
ARAPFIELDS_DECLARE(void radial_forward(const RadialBlock<float>&, const float* coefficients, int columns,
                                       float* jets))
ARAPFIELDS_DECLARE(void radial_forward(const RadialBlock<double>&, const double* coefficients, int columns,
                                       double* jets))
// Adds to the partial sums what cotangents (columns, 3, 16) are worth.
ARAPFIELDS_DECLARE(void radial_backward(const RadialBlock<float>&, const float* cotangents, int columns,
                                        float* sums))
ARAPFIELDS_DECLARE(void radial_backward(const RadialBlock<double>&, const double* cotangents, int columns,
                                        double* sums))
// Jets of each active bump: (active, columns, 16).
ARAPFIELDS_DECLARE(void radial_rows(const RadialBlock<double>&, int columns, double* rows))
// Lists the bumps whose support meets the ball of radius `reach` around `center`; returns how many.
ARAPFIELDS_DECLARE(std::int64_t radial_active(const double* center, double reach, const double* bumps,
                                              std::int64_t count, std::int32_t* active))
// distance ← min(distance, |point − from|²) for points (3, stride); `count` is a multiple of 16. The largest.
ARAPFIELDS_DECLARE(double farthest_update(const double* points, std::int64_t stride, std::int64_t count,
                                          const double* from, double* distance))

}  // namespace arapfields
