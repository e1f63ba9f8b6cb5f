// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/jets.h"
#include "core/types.h"

namespace arapfields {

/// The Jacobian at a point, from jets of at least first order.
template <class Scalar>
Mat3 jacobian_at(JetView<const Scalar> jets, Index point) {
  Mat3 j;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i) j(i, k) = static_cast<double>(jets.at(first_column(k), point)[i]);
  return j;
}

/// det(J) J⁻ᵀ, also where J has no inverse.
inline Mat3 cofactors(const Mat3& j) {
  Mat3 c;
  for (int k = 0; k < 3; ++k) {
    const Vec3 a = j.col((k + 1) % 3), b = j.col((k + 2) % 3);
    c.col(k) << a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0];
  }
  return c;
}

/// The normal of a moved surface, as long as the factor by which its area grows.
inline Vec3 area_vector(const Mat3& jacobian, const Vec3& normal) {
  const Mat3 c = cofactors(jacobian);
  return normal[0] * c.col(0) + normal[1] * c.col(1) + normal[2] * c.col(2);
}

}  // namespace arapfields
