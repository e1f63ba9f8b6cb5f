// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels of radial fields, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Power κ of the bumps φ(s) = (1 − s/κ)₊^κ, s = |x − p|²/r²; they vanish at √κ radii.
constexpr int radial_power = 6;

/// Numbers of a bump: center, 1/r², lifted center, 0.
constexpr int radial_bump = 8;
/// Rows of 16 numbers that a block's lift has: ψ, its first derivatives, its second ones, and the products
/// ∂_i ψ · ∂_j ψ, in the order of jets; fewer where the order of jets asks for less.
constexpr int radial_lift_rows(int columns) { return columns == 10 ? 36 : 3 * columns; }

/// One block of 16 points and the bumps it feels. Coefficients are rows of 3.
template <class Scalar>
struct RadialBlock {
  const Scalar* points;  // (3, 16)
  const Scalar* lift;    // (radial_lift_rows, 16), or null
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
// Lists the bumps whose support meets the ball of radius reach[0] around center[0..2], lifted into the ball
// of radius reach[1] around center[3..5]; returns how many.
ARAPFIELDS_DECLARE(std::int64_t radial_active(const double* center, const double* reach, const double* bumps,
                                              std::int64_t count, std::int32_t* active))
// distance ← min(distance, |point − from|²) for points (3, stride); `count` is a multiple of 16. The largest.
ARAPFIELDS_DECLARE(double farthest_update(const double* points, std::int64_t stride, std::int64_t count,
                                          const double* from, double* distance))

}  // namespace arapfields
