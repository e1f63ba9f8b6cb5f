// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

/// Entries [0, count) of parameters, gradient and the two running moments. `rate` is the learning rate over
/// the first moment's bias correction, `scale` one over the square root of the second's.
template <class Scalar>
struct AdamBlock {
  Scalar* parameters = nullptr;
  const Scalar* gradient = nullptr;
  Scalar* mean = nullptr;
  Scalar* square = nullptr;
  std::int64_t count = 0;
  Scalar beta1 = 0, beta2 = 0, rate = 0, scale = 0, epsilon = 0;
};

ARAPFIELDS_DECLARE(template <class Scalar> void adam(const AdamBlock<Scalar>& block))

}  // namespace arapfields
