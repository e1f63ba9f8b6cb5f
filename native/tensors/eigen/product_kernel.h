// SPDX-License-Identifier: GPL-3.0-or-later
// Products and factors of matrices by Eigen, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// A matrix whose rows, or whose columns, are contiguous and `stride` apart.
template <class Scalar>
struct Strided {
  Scalar* data = nullptr;
  std::int64_t rows = 0, columns = 0, stride = 0;
  bool by_rows = true;
};

// c += factor·a b; c by rows.
ARAPFIELDS_DECLARE(void add_block_product(const Strided<float>& c, const Strided<const float>& a,
                                          const Strided<const float>& b, float factor))
ARAPFIELDS_DECLARE(void add_block_product(const Strided<double>& c, const Strided<const double>& a,
                                          const Strided<const double>& b, double factor))
// a becomes its lower Cholesky factor, and zero above; whether it is positive definite.
ARAPFIELDS_DECLARE(bool factorize_block(const Strided<float>& a))
ARAPFIELDS_DECLARE(bool factorize_block(const Strided<double>& a))
// b becomes the solution X of L X = b for a lower triangular L.
ARAPFIELDS_DECLARE(void solve_lower_block(const Strided<const float>& lower, const Strided<float>& b))
ARAPFIELDS_DECLARE(void solve_lower_block(const Strided<const double>& lower, const Strided<double>& b))
// The same of an upper triangular one.
ARAPFIELDS_DECLARE(void solve_upper_block(const Strided<const float>& upper, const Strided<float>& b))
ARAPFIELDS_DECLARE(void solve_upper_block(const Strided<const double>& upper, const Strided<double>& b))

}  // namespace arapfields
