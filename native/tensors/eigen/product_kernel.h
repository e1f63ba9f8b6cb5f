// SPDX-License-Identifier: GPL-3.0-or-later
// Products of matrices, and the loops within their factors, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Entry (i, j) lies at data[i·row + j·column].
template <class Scalar>
struct Strided {
  Scalar* data = nullptr;
  std::int64_t row = 0;
  std::int64_t column = 0;
};

/// Parts of b in the order in which the product reads them: what the caller lends to each thread.
constexpr std::int64_t product_inner = 256;
constexpr std::int64_t product_columns = 512;
constexpr std::int64_t product_buffer = product_inner * product_columns;

/// c (rows, columns) = factor·a b, or this added to it. Rows of c are contiguous.
template <class Scalar>
struct ProductBlock {
  Strided<Scalar> c;
  Strided<const Scalar> a;
  Strided<const Scalar> b;
  std::int64_t rows;
  std::int64_t inner;
  std::int64_t columns;
  Scalar factor;
  bool add;
  Scalar* buffer;  // product_buffer numbers
};
ARAPFIELDS_DECLARE(void multiply_block(const ProductBlock<float>& block))
ARAPFIELDS_DECLARE(void multiply_block(const ProductBlock<double>& block))

/// b (size, columns) becomes X of a X = b, by substitution from the top, or from the bottom where a is upper.
/// Rows of b are contiguous.
template <class Scalar>
struct SubstitutionBlock {
  Strided<const Scalar> a;
  Strided<Scalar> b;
  std::int64_t size, columns;
  bool upper;
};
ARAPFIELDS_DECLARE(void substitute_block(const SubstitutionBlock<float>& block))
ARAPFIELDS_DECLARE(void substitute_block(const SubstitutionBlock<double>& block))

}  // namespace arapfields
