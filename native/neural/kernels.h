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

/// One layer's part in the second derivatives of the network's outputs. With q_o = ∂(output o)/∂h of this
/// layer, ∂_ij(output o) is the sum over all layers and units of q_o φ''(z) ∂_i z ∂_j z (and of the
/// encoding's own curvature): no second derivative need travel through the layers.
template <class Scalar>
struct AdjointBlock {
  const Scalar* activations =
      nullptr;  ///< (4, points, width), as activate() leaves them: ∂_i z in activations 1 to 3
  const Scalar* slope = nullptr;     ///< (points, width): φ'
  const Scalar* adjoints = nullptr;  ///< (outputs, points, width): q
  bool shared = false;               ///< q is (outputs, width), the same for all points
  Scalar* below = nullptr;           ///< (outputs, points, width): φ' q = ∂(output)/∂z
  Scalar sharpness = 1;
  std::int64_t points = 0;
  std::int64_t width = 0;
  int outputs = 3;
};

// Fills `below`; adds to `second` (points, 6, outputs), pairs in the order of the jets' columns.
ARAPFIELDS_DECLARE(template <class Scalar> void adjoint(const AdjointBlock<Scalar>& block, Scalar* second))
// Cotangents (outputs, points, width) of `below` become those of q. `second` holds the cotangents of the
// second derivatives; `partial` (4, points, width) receives those of the activations. Fills `below`.
ARAPFIELDS_DECLARE(template <class Scalar> void adjoint_back(const AdjointBlock<Scalar>& block,
                                                             const Scalar* second, Scalar* cotangents,
                                                             Scalar* partial))

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
