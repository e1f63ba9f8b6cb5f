// SPDX-License-Identifier: GPL-3.0-or-later
// What both ways of training an inverse share.
#pragma once

#include "core/random.h"
#include "core/tensors.h"

namespace arapfields {

inline Points uniform_in(const Vec3& low, const Vec3& high, Index count, Random& random) {
  Points points(count, 3);
  for (Index p = 0; p < count; ++p)
    for (int i = 0; i < 3; ++i) points(p, i) = random.uniform(low[i], high[i]);
  return points;
}

/// Rows J_pᵀ r_p.
inline at::Tensor transposed_times(const at::Tensor& jets, const at::Tensor& residuals) {
  return (jets.slice(0, first_column(0), first_column(3)) * residuals).sum(2).t();
}

}  // namespace arapfields
