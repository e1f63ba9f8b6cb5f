// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// One layer's softplus on the jets of a block of points. `activations` = (columns, points, width),
/// contiguous. Before: plane 0 holds z without its bias; after activate(): φ(z + bias). The activations of ∂
/// keep z until activate_back() turns them into those of h. `slope` (points, width) receives φ'.
template <class Scalar>
struct ActivationBlock {
  Scalar* activations = nullptr;
  Scalar* slope = nullptr;  ///< may be null in activate(): nothing is kept then
  Scalar* jets =
      nullptr;  ///< (columns, points, width): h; not used with one column, where activations holds h
  const Scalar* bias = nullptr;
  Scalar sharpness = 1;
  std::int64_t points = 0;
  std::int64_t width = 0;
  int columns = 1;  ///< 1: values; 4: values and first derivatives
};

/// The encoding of a block of points and its derivatives by the coordinate that each entry depends on.
template <class Scalar>
struct EncodingBlock {
  const Scalar* points = nullptr;  ///< (points, 3)
  Scalar* value = nullptr;         ///< (points, 6·octaves); derivatives have the same shape, or are null
  Scalar* first = nullptr;
  Scalar* second = nullptr;
  double frequency = 0.0;
  std::int64_t count = 0;
  int octaves = 0;
};

ARAPFIELDS_DECLARE(template <class Scalar> void activate(const ActivationBlock<Scalar>& block))
// Cotangents (columns, points, width) of h become those of z, with `partial` (of their shape, or null) added;
// bias_gradient (width) is added to.
ARAPFIELDS_DECLARE(template <class Scalar> void activate_back(const ActivationBlock<Scalar>& block,
                                                              const Scalar* partial, Scalar* cotangents,
                                                              Scalar* bias_gradient))
ARAPFIELDS_DECLARE(template <class Scalar> void encode(const EncodingBlock<Scalar>& block))

}  // namespace arapfields
