// SPDX-License-Identifier: GPL-3.0-or-later
// Jets of one number by two others, columns as in core/jets2d.h: how they are lifted to jets of space, and
// the way back.
#pragma once

#include "core/jets2d.h"
#include "neural/jet_algebra.h"

namespace arapfields {

/// The jet of a function of the plane, or the cotangents of one.
template <class Scalar>
struct PlaneJet {
  Scalar c[columns2] = {};

  Scalar& operator[](int i) { return c[i]; }
  Scalar operator[](int i) const { return c[i]; }
};

/// g(u, v), of g's jet there.
template <class Scalar>
NumberJet<Scalar> chain(const PlaneJet<Scalar>& g, const NumberJet<Scalar>& u, const NumberJet<Scalar>& v,
                        int columns) {
  NumberJet<Scalar> h;
  h[0] = g[0];
  for (int i = 1; i < columns; ++i) h[i] = g[1] * u[i] + g[2] * v[i];
  if (columns < 10) return h;
  for (int j = 1; j < 4; ++j)
    for (int k = j; k < 4; ++k)
      h[second_column(j - 1, k - 1)] +=
          g[3] * u[j] * u[k] + g[4] * v[j] * v[k] + g[5] * (u[j] * v[k] + u[k] * v[j]);
  return h;
}

/// Adds what the cotangents of g(u, v) ask to those of the derivatives of u and v, and returns what they ask
/// of g's jet. The derivatives of g's jet at the values of u and v are the caller's.
template <class Scalar>
PlaneJet<Scalar> chain_back(const PlaneJet<Scalar>& g, const NumberJet<Scalar>& u, const NumberJet<Scalar>& v,
                            const NumberJet<Scalar>& given, NumberJet<Scalar>& back_u,
                            NumberJet<Scalar>& back_v, int columns) {
  PlaneJet<Scalar> of_g;
  of_g[0] = given[0];
  for (int i = 1; i < columns; ++i) {
    of_g[1] += u[i] * given[i];
    of_g[2] += v[i] * given[i];
    back_u[i] += g[1] * given[i];
    back_v[i] += g[2] * given[i];
  }
  if (columns < 10) return of_g;
  for (int j = 1; j < 4; ++j)
    for (int k = j; k < 4; ++k) {
      const Scalar w = given[second_column(j - 1, k - 1)];
      of_g[3] += w * u[j] * u[k];
      of_g[4] += w * v[j] * v[k];
      of_g[5] += w * (u[j] * v[k] + u[k] * v[j]);
      back_u[j] += w * (g[3] * u[k] + g[5] * v[k]);
      back_u[k] += w * (g[3] * u[j] + g[5] * v[j]);
      back_v[j] += w * (g[4] * v[k] + g[5] * u[k]);
      back_v[k] += w * (g[4] * v[j] + g[5] * u[j]);
    }
  return of_g;
}

}  // namespace arapfields
