// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/jets.h"
#include "core/types.h"

namespace arapfields {

/// Jet of a scalar at one point, in the columns of core/jets.h.
struct ScalarJet {
  std::array<double, 10> c{};
};

inline ScalarJet constant(double value) { return {{value}}; }

/// offset + direction·x at x.
inline ScalarJet linear(const Vec3& direction, double offset, const Vec3& x) {
  return {{offset + direction.dot(x), direction[0], direction[1], direction[2]}};
}

inline ScalarJet operator*(const ScalarJet& a, const ScalarJet& b) {
  ScalarJet r;
  r.c[0] = a.c[0] * b.c[0];
  for (int j = 0; j < 3; ++j) {
    const int cj = first_column(j);
    r.c[cj] = a.c[0] * b.c[cj] + a.c[cj] * b.c[0];
    for (int k = j; k < 3; ++k) {
      const int ck = first_column(k), cjk = second_column(j, k);
      r.c[cjk] = a.c[0] * b.c[cjk] + a.c[cjk] * b.c[0] + a.c[cj] * b.c[ck] + a.c[ck] * b.c[cj];
    }
  }
  return r;
}

inline ScalarJet& operator+=(ScalarJet& a, const ScalarJet& b) {
  for (std::size_t i = 0; i < a.c.size(); ++i) a.c[i] += b.c[i];
  return a;
}

inline ScalarJet one_minus(ScalarJet a) {
  for (double& value : a.c) value = -value;
  a.c[0] += 1.0;
  return a;
}

/// 1 for t ≤ 0, 0 for t ≥ 1, between them the polynomial of degree 7 whose first three derivatives vanish at
/// both ends; with its first two derivatives.
inline std::array<double, 3> fall_off(double t) {
  if (t <= 0.0) return {1.0, 0.0, 0.0};
  if (t >= 1.0) return {0.0, 0.0, 0.0};
  const double u = 1.0 - t;
  return {1.0 - t * t * t * t * (35.0 - t * (84.0 - t * (70.0 - 20.0 * t))), -140.0 * t * t * t * u * u * u,
          -420.0 * t * t * u * u * (u - t)};
}

}  // namespace arapfields
