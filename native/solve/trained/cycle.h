// SPDX-License-Identifier: GPL-3.0-or-later
// Helpers of the two objectives that train an inverse (inverse_training, invertible_objective).
#pragma once

#include "core/random.h"
#include "tensors/views.h"

namespace arapfields {

inline Points uniform_in(const Vec3& low, const Vec3& high, Index count, Random& random) {
  Points points(count, 3);
  for (Index p = 0; p < count; ++p)
    for (int i = 0; i < 3; ++i) points(p, i) = random.uniform(low[i], high[i]);
  return points;
}

/// Rows J_pᵀ r_p.
inline Tensor transposed_times(const Tensor& jets, const Tensor& residuals) {
  return sum(jets.slice(0, first_column(0), first_column(3)) * residuals, {2}).t();
}

}  // namespace arapfields
