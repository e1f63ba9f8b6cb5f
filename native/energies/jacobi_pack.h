// SPDX-License-Identifier: GPL-3.0-or-later
// Eigenvectors of many symmetric 4×4 matrices at once, for SIMD sources.
#pragma once

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {

/// One Jacobi rotation in the plane (p, q) of the symmetric a and the columns of v.
template <class Scalar>
inline void jacobi_rotate(Pack<Scalar> (&a)[4][4], Pack<Scalar> (&v)[4][4], int p, int q) {
  using P = Pack<Scalar>;
  constexpr Scalar tiny = sizeof(Scalar) == 4 ? Scalar(1e-30) : Scalar(1e-200);
  const P off = a[p][q], d = a[q][q] - a[p][p], zero = {};
  const P root = square_root(d * d + Scalar(4) * off * off);
  const P tangent = Scalar(2) * off / (d >= zero ? d + root + tiny : d - root - tiny);
  const P cosine = Scalar(1) / square_root(tangent * tangent + Scalar(1)), sine = tangent * cosine;
  a[p][p] -= tangent * off;
  a[q][q] += tangent * off;
  a[p][q] = a[q][p] = zero;
  for (int k = 0; k < 4; ++k) {
    if (k != p && k != q) {
      const P x = a[k][p], y = a[k][q];
      a[k][p] = a[p][k] = cosine * x - sine * y;
      a[k][q] = a[q][k] = sine * x + cosine * y;
    }
    const P x = v[k][p], y = v[k][q];
    v[k][p] = cosine * x - sine * y;
    v[k][q] = sine * x + cosine * y;
  }
}

/// Diagonalises a; sweeps until every lane's off-diagonal part has vanished to rounding.
template <class Scalar>
inline void jacobi_diagonalise(Pack<Scalar> (&a)[4][4], Pack<Scalar> (&v)[4][4]) {
  constexpr Scalar negligible = sizeof(Scalar) == 4 ? Scalar(1e-15) : Scalar(1e-33);
  for (int sweep = 0; sweep < 12; ++sweep) {
    const Pack<Scalar> off = a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[0][3] * a[0][3] + a[1][2] * a[1][2] +
                             a[1][3] * a[1][3] + a[2][3] * a[2][3];
    Scalar worst = 0;
    for (int i = 0; i < lanes<Scalar>; ++i) worst = off[i] > worst ? off[i] : worst;
    if (!(worst > negligible)) return;
    jacobi_rotate<Scalar>(a, v, 0, 1);
    jacobi_rotate<Scalar>(a, v, 0, 2);
    jacobi_rotate<Scalar>(a, v, 0, 3);
    jacobi_rotate<Scalar>(a, v, 1, 2);
    jacobi_rotate<Scalar>(a, v, 1, 3);
    jacobi_rotate<Scalar>(a, v, 2, 3);
  }
}

}  // namespace arapfields::SIMD_LEVEL
