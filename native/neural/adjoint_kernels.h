// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

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

}  // namespace arapfields
