// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels of this folder, compiled for each instruction set. All take the whole block and a range of points.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Lower clamp of K's eigenvalues, sums of two signed singular values; at 0 R is ambiguous.
constexpr double smallest_sum = 0.01;

/// Columns of `jets` and `cotangents` (null: values alone) are count·3 apart. Factors (count; null: ones) are
/// the points' own. Sums, not means, are added to sums[0] (stretch), sums[1] (bend) and sums[2] (stretch +
/// bending·bend, with the factors).
template <class Scalar>
struct ArapBlock {
  const Scalar* jets;
  Scalar* cotangents;
  std::int64_t count;
  bool has_second, second_cotangents;
  Scalar stretch_weight, bend_weight, bending;
  const Scalar* factors;          // on the energy
  const Scalar* bending_factors;  // on the bending
};

/// Same blocks, with rest normals (count,3), per-sample weights (count; null: ones), and the preference as k
/// rows (normal, weight); adds Σ u (1 − g) to the result. With targets (count,3; else null) Σ u ‖ñ − t‖², and
/// the sharpness is 2.
template <class Scalar>
struct GaussBlock {
  const Scalar* jets;
  Scalar* cotangents;
  std::int64_t count;
  const Scalar* normals;
  const Scalar* sample_weights;
  const Scalar* preferred;
  std::int64_t preferred_count;
  const Scalar* targets;
  Scalar sharpness, weight;
};

ARAPFIELDS_DECLARE(template <class Scalar> void arap_range(const ArapBlock<Scalar>&, std::int64_t begin,
                                                           std::int64_t end, double* sums))
ARAPFIELDS_DECLARE(template <class Scalar>
                   double gauss_range(const GaussBlock<Scalar>&, std::int64_t begin, std::int64_t end))
ARAPFIELDS_DECLARE(template <class Scalar> void rotation_range(const Scalar* jacobians, std::int64_t count,
                                                               std::int64_t begin, std::int64_t end,
                                                               Scalar* rotations))
// Joins (min det, share ≤ 0 as a count, max and min singular value) of the range to out[4].
ARAPFIELDS_DECLARE(template <class Scalar> void distortion_range(const Scalar* jets, std::int64_t count,
                                                                 std::int64_t begin, std::int64_t end,
                                                                 double* out))

}  // namespace arapfields
