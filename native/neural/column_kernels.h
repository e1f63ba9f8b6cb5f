// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// One layer's softplus on jets of the plane all of whose columns travel through the layers: planes
/// (points, width), one a column (core/jets2d.h). `z` holds the pre-activations, its plane 0 without the
/// bias; `h` receives the jets of φ, and `slope` (points, width; null: not kept) φ'.
template <class Scalar>
struct ColumnBlock {
  const Scalar* z = nullptr;
  Scalar* h = nullptr;
  Scalar* slope = nullptr;
  const Scalar* bias = nullptr;
  Scalar sharpness = 1;
  std::int64_t points = 0;
  std::int64_t width = 0;
  int columns = 1;  ///< 1, 3 or 6
};

ARAPFIELDS_DECLARE(template <class Scalar> void activate_columns(const ColumnBlock<Scalar>& block))
// Cotangents of h (columns, points, width) become those of z; bias_gradient (width) is added to.
ARAPFIELDS_DECLARE(template <class Scalar> void activate_columns_back(const ColumnBlock<Scalar>& block,
                                                                      Scalar* cotangents,
                                                                      Scalar* bias_gradient))

}  // namespace arapfields
