// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pack.h"

// Closest rotations of many 3×3 matrices at once, for SIMD sources.

namespace arapfields::SIMD_LEVEL {

// Eigenvectors of many symmetric 4×4 matrices at once, for SIMD sources.

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

template <class Scalar>
using Pack3 = Pack<Scalar>[3];
template <class Scalar>
using Pack33 = Pack<Scalar>[3][3];

/// R closest to J, and K = tr(Y) I − Y with Y = RᵀJ as eigenvalues (two signed singular values' sums, ≥ 0)
/// and unit eigenvectors axes[0..2].
template <class Scalar>
struct RotationPack {
  Pack33<Scalar> rotation;
  Pack33<Scalar> axes;
  Pack3<Scalar> sums;
};

/// Jacobians of `lanes` points from first derivatives (3, count, 3): column k of point p at (k·count + p)·3.
template <class Scalar>
inline void load_jacobians(const Scalar* from, std::int64_t count, std::int64_t point, std::int64_t valid,
                           Pack33<Scalar>& jacobians) {
  for (int k = 0; k < 3; ++k) {
    Pack3<Scalar> column;
    load_points(from + (k * count + point) * 3, valid, column);
    for (int i = 0; i < 3; ++i) jacobians[i][k] = column[i];
  }
}

/// Unit quaternions q: tr(R(q)ᵀJ) = qᵀNq for a symmetric 4×4 N linear in J, so the closest rotation is N's
/// top eigenvector, whatever J's rank and determinant. The others are q·(0, v_i), v_i K's eigenvectors, and
/// the gaps to the top are twice K's eigenvalues (Horn 1987, "Closed-form solution of absolute orientation
/// using unit quaternions", for N; the rest follows by writing J = R Y).
template <class Scalar>
inline void closest_rotation(const Pack33<Scalar>& jacobian, RotationPack<Scalar>& out) {
  using P = Pack<Scalar>;
  const P zero = {}, one = broadcast(Scalar(1));
  P scale = zero;
  for (const auto& row : jacobian)
    for (const P& x : row) {
      const P magnitude = x < zero ? -x : x;
      scale = magnitude > scale ? magnitude : scale;
    }
  const P inverse_scale = scale > zero ? Scalar(1) / scale : one;
  P j[3][3];
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) j[i][k] = jacobian[i][k] * inverse_scale;
  P a[4][4], v[4][4];
  a[0][0] = j[0][0] + j[1][1] + j[2][2];
  a[1][1] = j[0][0] - j[1][1] - j[2][2];
  a[2][2] = j[1][1] - j[0][0] - j[2][2];
  a[3][3] = j[2][2] - j[0][0] - j[1][1];
  a[0][1] = a[1][0] = j[2][1] - j[1][2];
  a[0][2] = a[2][0] = j[0][2] - j[2][0];
  a[0][3] = a[3][0] = j[1][0] - j[0][1];
  a[1][2] = a[2][1] = j[0][1] + j[1][0];
  a[1][3] = a[3][1] = j[0][2] + j[2][0];
  a[2][3] = a[3][2] = j[1][2] + j[2][1];
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) v[i][k] = i == k ? one : zero;
  jacobi_diagonalise<Scalar>(a, v);
  for (int c = 1; c < 4; ++c) {
    const auto swap = a[c][c] > a[0][0];
    const P top = a[0][0];
    a[0][0] = swap ? a[c][c] : top;
    a[c][c] = swap ? top : a[c][c];
    for (int k = 0; k < 4; ++k) {
      const P x = v[k][0];
      v[k][0] = swap ? v[k][c] : x;
      v[k][c] = swap ? x : v[k][c];
    }
  }
  const P norm =
      Scalar(1) / square_root(v[0][0] * v[0][0] + v[1][0] * v[1][0] + v[2][0] * v[2][0] + v[3][0] * v[3][0]);
  const P w = v[0][0] * norm, x = v[1][0] * norm, y = v[2][0] * norm, z = v[3][0] * norm;
  auto& r = out.rotation;
  r[0][0] = one - Scalar(2) * (y * y + z * z);
  r[1][1] = one - Scalar(2) * (x * x + z * z);
  r[2][2] = one - Scalar(2) * (x * x + y * y);
  r[0][1] = Scalar(2) * (x * y - w * z);
  r[1][0] = Scalar(2) * (x * y + w * z);
  r[0][2] = Scalar(2) * (x * z + w * y);
  r[2][0] = Scalar(2) * (x * z - w * y);
  r[1][2] = Scalar(2) * (y * z - w * x);
  r[2][1] = Scalar(2) * (y * z + w * x);
  for (int c = 1; c < 4; ++c) {  // the vector part of conj(q)·q_c
    const P b = v[0][c], bx = v[1][c], by = v[2][c], bz = v[3][c];
    out.axes[c - 1][0] = w * bx - b * x - (y * bz - z * by);
    out.axes[c - 1][1] = w * by - b * y - (z * bx - x * bz);
    out.axes[c - 1][2] = w * bz - b * z - (x * by - y * bx);
    out.sums[c - 1] = Scalar(0.5) * (a[0][0] - a[c][c]) * scale;
  }
}

}  // namespace arapfields::SIMD_LEVEL
