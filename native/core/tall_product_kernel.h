// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels of TallMatrix, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Rows `stride` (a multiple of 64) apart; with `lower` row i ends at column i.
template <class Scalar>
struct TallBlock {
  const Scalar* values;
  std::int64_t stride;
  bool lower;
};

// Rows begin … end−1 of A B into out (rows, 3), B given as three columns `stride` long.
ARAPFIELDS_DECLARE(template <class Scalar> void tall_product_rows(const TallBlock<Scalar>&,
                                                                  std::int64_t begin, std::int64_t end,
                                                                  const Scalar* b, Scalar* out))
// Columns first … first+63 of (Aᵀ B)ᵀ into out, three rows `stride` long, for B (rows, 3).
ARAPFIELDS_DECLARE(template <class Scalar> void tall_product_strip(const TallBlock<Scalar>&,
                                                                   std::int64_t first, std::int64_t rows,
                                                                   const Scalar* b, Scalar* out))

}  // namespace arapfields
