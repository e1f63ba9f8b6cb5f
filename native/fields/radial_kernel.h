// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels of radial fields, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Power κ of the centers φ(s) = (1 − s/κ)₊^κ, s = |x − p|²/r²; they vanish at √κ radii.
constexpr int radial_power = 6;

/// Numbers stored for a center: position, 1/r², embedded position, 0.
constexpr int center_stride = 8;
/// Rows of 16 numbers that a block's embedding has: ψ, its first derivatives, its second ones, and the
/// products ∂_i ψ · ∂_j ψ, in the order of jets; fewer for jets of lower order.
constexpr int embedding_rows(int columns) { return columns == 10 ? 36 : 3 * columns; }

/// One block of 16 points and the centers whose support meets it. Coefficients are rows of 3.
template <class Scalar>
struct RadialBlock {
  const Scalar* points;     // (3, 16)
  const Scalar* embedding;  // (embedding_rows, 16), or null
  const Scalar* centers;
  const std::int32_t* active;
  std::int64_t active_count;
};

/// Lanes of the gradient's partial sums, (m, 3, radial_lanes).
constexpr int radial_lanes = 16;

// Jets (columns, 3, 16) of the centers' part.
ARAPFIELDS_DECLARE(template <class Scalar> void radial_forward(const RadialBlock<Scalar>&,
                                                               const Scalar* coefficients, int columns,
                                                               Scalar* jets))
// Adds the pull-back of cotangents (columns, 3, 16) to the partial sums.
ARAPFIELDS_DECLARE(template <class Scalar> void radial_backward(const RadialBlock<Scalar>&,
                                                                const Scalar* cotangents, int columns,
                                                                Scalar* sums))
// Jets of each active bump: (active, columns, 16).
ARAPFIELDS_DECLARE(void radial_rows(const RadialBlock<double>&, int columns, double* rows))
// Lists the centers whose support meets the ball of radius ball_radius[0] around center[0..2], embedded into
// the ball of radius ball_radius[1] around center[3..5]; returns how many.
ARAPFIELDS_DECLARE(std::int64_t radial_active(const double* center, const double* ball_radius,
                                              const double* centers, std::int64_t count,
                                              std::int32_t* active))
// distance ← min(distance, weight |point − from|²) for points (dimensions, count); `count` is a multiple
// of 16. The largest.
ARAPFIELDS_DECLARE(double farthest_update(const double* points, int dimensions, const double* weights,
                                          std::int64_t count, const double* from, double* distance))

}  // namespace arapfields
