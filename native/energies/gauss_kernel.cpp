// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/pack_exp.h"
#include "core/pack_points.h"
#include "energies/kernels.h"

namespace arapfields::SIMD_LEVEL {
namespace {

template <class Scalar>
using Vector3 = Pack<Scalar>[3];

template <class Scalar>
inline void cross(const Vector3<Scalar>& a, const Vector3<Scalar>& b, Vector3<Scalar>& out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

template <class Scalar>
inline Pack<Scalar> dot(const Vector3<Scalar>& a, const Vector3<Scalar>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace

/// With J's columns j_k, cof(J) n = n_1 j_2×j_3 + n_2 j_3×j_1 + n_3 j_1×j_2, and J⁻ᵀn has its direction times
/// the sign of det J. A cotangent h of cof(J) n is one of j_k: h × (n_{k+1} j_{k+2} − n_{k+2} j_{k+1}).
template <class Scalar>
double gauss_range(const GaussBlock<Scalar>& block, std::int64_t begin, std::int64_t end) {
  using P = Pack<Scalar>;
  const P zero = {}, one = broadcast(Scalar(1)), shortest = broadcast(Scalar(1e-3));
  double sum = 0;
  for (std::int64_t point = begin; point < end; point += lanes<Scalar>) {
    const std::int64_t valid = end - point;
    P j[3][3], n[3], unit[3], weights = one;
    for (int k = 0; k < 3; ++k) load_points(block.jets + ((1 + k) * block.count + point) * 3, valid, j[k]);
    load_points(block.normals + point * 3, valid, n);
    if (block.sample_weights != nullptr)
      for (int i = 0; i < lanes<Scalar>; ++i)
        weights[i] = block.sample_weights[point + (i < valid ? i : valid - 1)];
    P minors[3][3];
    for (int k = 0; k < 3; ++k) cross<Scalar>(j[(k + 1) % 3], j[(k + 2) % 3], minors[k]);
    const P sign = dot<Scalar>(j[0], minors[0]) < zero ? -one : one;
    for (int i = 0; i < 3; ++i)
      unit[i] = sign * (n[0] * minors[0][i] + n[1] * minors[1][i] + n[2] * minors[2][i]);
    const P length = square_root(dot<Scalar>(unit, unit));
    const P inverse_length = one / (length > shortest ? length : shortest);
    for (auto& x : unit) x *= inverse_length;

    P loss = one, by_normal[3] = {zero, zero, zero};
    if (block.targets != nullptr) {
      load_points(block.targets + point * 3, valid, by_normal);
      for (int i = 0; i < 3; ++i) by_normal[i] -= unit[i];
      loss = dot<Scalar>(by_normal, by_normal);
    }
    for (std::int64_t k = 0; k < block.preferred_count; ++k) {
      const Scalar* row = block.preferred + 4 * k;
      const P dots = unit[0] * row[0] + unit[1] * row[1] + unit[2] * row[2];
      const P term = row[3] * exponential<Scalar>(block.sharpness * dots);
      loss -= term;
      for (int i = 0; i < 3; ++i) by_normal[i] += term * row[i];
    }
    for (int i = 0; i < lanes<Scalar> && i < valid; ++i) sum += static_cast<double>(weights[i] * loss[i]);
    if (block.cotangents == nullptr) continue;

    const P scale = -block.weight * block.sharpness * weights * sign * inverse_length;
    const P along = length > shortest ? dot<Scalar>(unit, by_normal) : zero;
    P h[3];
    for (int i = 0; i < 3; ++i) h[i] = scale * (by_normal[i] - along * unit[i]);
    for (int k = 0; k < 3; ++k) {
      const int a = (k + 1) % 3, b = (k + 2) % 3;
      P arm[3], column[3];
      for (int i = 0; i < 3; ++i) arm[i] = n[a] * j[b][i] - n[b] * j[a][i];
      cross<Scalar>(h, arm, column);
      add_points(block.cotangents + ((1 + k) * block.count + point) * 3, valid, column);
    }
  }
  return sum;
}
template double gauss_range(const GaussBlock<float>&, std::int64_t, std::int64_t);
template double gauss_range(const GaussBlock<double>&, std::int64_t, std::int64_t);

}  // namespace arapfields::SIMD_LEVEL
