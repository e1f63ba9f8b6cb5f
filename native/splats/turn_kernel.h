// SPDX-License-Identifier: GPL-3.0-or-later
// Shapes and colours of splats under a linear map, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"
#include "splats/harmonics.h"
#include "splats/splat_column.h"

namespace arapfields {

/// Splats i = 0 … count−1: row from[i] of what is at rest becomes row to[i] of what is moved. Rows are laid
/// out as GaussianSplats has them.
template <class Scalar>
struct SplatBatch {
  const Scalar* jacobians;  ///< (3, count, 3), the first derivatives of jets
  std::int64_t count;
  const std::int64_t* from;
  const std::int64_t* to;
  const float* rotations;
  const float* log_scales;
  const float* harmonics;
  float* moved_rotations;
  float* moved_log_scales;
  float* moved_harmonics;
  int functions;  ///< 1, 4, 9 or 16 harmonics
  const HarmonicTables<Scalar>* tables;
  Scalar* stretches;  ///< (count, 3) |J u| for the axes u at rest
};

/// Splats of which all that a motion changes are columns, in the order of PreparedSplats::changes().
struct SplatColumnBatch {
  const float* jacobians;  ///< (n, 9): ∂_1 f, ∂_2 f, ∂_3 f
  const SplatColumn* columns;
  int functions;
  const HarmonicTables<float>* tables;
};

// Covariances J Σ Jᵀ, and colours turned by the rotation closest to J, for splats begin to end − 1.
ARAPFIELDS_DECLARE(template <class Scalar>
                   void turn_splats(const SplatBatch<Scalar>&, std::int64_t begin, std::int64_t end))
// The same, as changes.
ARAPFIELDS_DECLARE(void turn_columns(const SplatColumnBatch&, std::int64_t begin, std::int64_t end))

}  // namespace arapfields
