// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/kernels.h"

#include "core/pack.h"
#include "energies/rotation_pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

constexpr int second_column[3][3] = {{4, 7, 8}, {7, 5, 9}, {8, 9, 6}};

template <class Scalar>
inline void product_transposed(const Pack33<Scalar>& a, const Pack33<Scalar>& b, Pack33<Scalar>& out) {
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) out[i][k] = a[0][i] * b[0][k] + a[1][i] * b[1][k] + a[2][i] * b[2][k];
}

/// axl(M): ⟨M, [w]×⟩ = w·axl(M).
template <class Scalar>
inline void axial(const Pack33<Scalar>& m, Pack3<Scalar>& out) {
  out[0] = m[2][1] - m[1][2];
  out[1] = m[0][2] - m[2][0];
  out[2] = m[1][0] - m[0][1];
}

/// K⁻¹ a, by K's eigenvectors.
template <class Scalar>
inline void solve_k(const RotationPack<Scalar>& polar, const Pack3<Scalar>& inverse, const Pack3<Scalar>& a,
                    Pack3<Scalar>& out) {
  Pack<Scalar> t[3];
  for (int c = 0; c < 3; ++c)
    t[c] = inverse[c] * (polar.axes[c][0] * a[0] + polar.axes[c][1] * a[1] + polar.axes[c][2] * a[2]);
  for (int i = 0; i < 3; ++i)
    out[i] = t[0] * polar.axes[0][i] + t[1] * polar.axes[1][i] + t[2] * polar.axes[2][i];
}

/// Column i of R[w]×: r_i × w in terms of R's rows, that is (R[w]×)_ij = (r_i × w)_j.
template <class Scalar>
inline void rotation_times_cross(const Pack33<Scalar>& r, const Pack3<Scalar>& w, Pack33<Scalar>& out) {
  for (int i = 0; i < 3; ++i) {
    out[i][0] = r[i][1] * w[2] - r[i][2] * w[1];
    out[i][1] = r[i][2] * w[0] - r[i][0] * w[2];
    out[i][2] = r[i][0] * w[1] - r[i][1] * w[0];
  }
}

/// Intermediate values of the bend of one pack of points, kept for its cotangents.
template <class Scalar>
struct Bend {
  Pack33<Scalar> a_matrix[3];  // A_k = Rᵀ D_k
  Pack3<Scalar> w[3];
  Pack3<Scalar> inverse_sums;
  Pack<Scalar> value;
};

template <class Scalar>
inline void evaluate_bend(const ArapBlock<Scalar>& block, std::int64_t point, std::int64_t valid,
                          const RotationPack<Scalar>& polar, Bend<Scalar>& bend) {
  Pack<Scalar> d[10][3];
  for (int c = 4; c < 10; ++c) load_points(block.jets + (c * block.count + point) * 3, valid, d[c]);
  for (int c = 0; c < 3; ++c) {
    const Pack<Scalar> least = broadcast(Scalar(smallest_sum));
    bend.inverse_sums[c] = Scalar(1) / (polar.sums[c] > least ? polar.sums[c] : least);
  }
  bend.value = Pack<Scalar>{};
  for (int k = 0; k < 3; ++k) {
    Pack33<Scalar> derivative;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) derivative[i][j] = d[second_column[j][k]][i];
    product_transposed<Scalar>(polar.rotation, derivative, bend.a_matrix[k]);
    Pack3<Scalar> a;
    axial<Scalar>(bend.a_matrix[k], a);
    solve_k<Scalar>(polar, bend.inverse_sums, a, bend.w[k]);
    bend.value += a[0] * bend.w[k][0] + a[1] * bend.w[k][1] + a[2] * bend.w[k][2];
  }
}

/// ∂b/∂D_k = 2 R[w_k]×, collected by columns.
template <class Scalar>
inline void add_second_cotangents(const ArapBlock<Scalar>& block, std::int64_t point, std::int64_t valid,
                                  const RotationPack<Scalar>& polar, const Bend<Scalar>& bend,
                                  Pack<Scalar> bend_weight) {
  Pack33<Scalar> by_slice[3];
  for (int k = 0; k < 3; ++k) rotation_times_cross<Scalar>(polar.rotation, bend.w[k], by_slice[k]);
  const Pack<Scalar> weight = Scalar(2) * bend_weight;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      Pack3<Scalar> column;
      for (int i = 0; i < 3; ++i)
        column[i] = weight * (j == k ? by_slice[k][i][j] : by_slice[k][i][j] + by_slice[j][i][k]);
      add_points(block.cotangents + (second_column[j][k] * block.count + point) * 3, valid, column);
    }
}

/// ∂b/∂J = R([z]× − B) with B = Σ(|w_k|² I − w_k w_kᵀ), M = BY − 2 Σ [w_k]× A_kᵀ, z = K⁻¹ axl(M).
template <class Scalar>
inline void add_bend_by_jacobian(const Pack33<Scalar>& jacobian, const RotationPack<Scalar>& polar,
                                 const Bend<Scalar>& bend, Pack<Scalar> weight, Pack33<Scalar>& gradient) {
  using P = Pack<Scalar>;
  Pack33<Scalar> b, y, m, turned;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      P entry = {};
      for (int k = 0; k < 3; ++k) entry -= bend.w[k][i] * bend.w[k][j];
      b[i][j] = entry;
    }
  const P trace = -(b[0][0] + b[1][1] + b[2][2]);
  for (int i = 0; i < 3; ++i) b[i][i] += trace;
  product_transposed<Scalar>(polar.rotation, jacobian, y);
  product_transposed<Scalar>(b, y, m);  // B is symmetric
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 3; ++j) {  // column j of [w]× A_kᵀ is w × (row j of A_k)
      const auto& w = bend.w[k];
      const auto& row = bend.a_matrix[k][j];
      m[0][j] -= Scalar(2) * (w[1] * row[2] - w[2] * row[1]);
      m[1][j] -= Scalar(2) * (w[2] * row[0] - w[0] * row[2]);
      m[2][j] -= Scalar(2) * (w[0] * row[1] - w[1] * row[0]);
    }
  Pack3<Scalar> axis, z;
  axial<Scalar>(m, axis);
  solve_k<Scalar>(polar, bend.inverse_sums, axis, z);
  rotation_times_cross<Scalar>(polar.rotation, z, turned);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const auto& r = polar.rotation[i];
      gradient[i][j] += weight * (turned[i][j] - (r[0] * b[0][j] + r[1] * b[1][j] + r[2] * b[2][j]));
    }
}

template <class Scalar>
inline double sum_of_valid(Pack<Scalar> values, std::int64_t valid) {
  double sum = 0;
  for (int i = 0; i < lanes<Scalar> && i < valid; ++i) sum += static_cast<double>(values[i]);
  return sum;
}

/// The points' factors; 1 if `factors` is null, and beyond the last valid point.
template <class Scalar>
inline Pack<Scalar> load_factors(const Scalar* factors, std::int64_t point, std::int64_t valid) {
  Pack<Scalar> result = broadcast(Scalar(1));
  if (factors == nullptr) return result;
  for (int i = 0; i < lanes<Scalar> && i < valid; ++i) result[i] = factors[point + i];
  return result;
}

}  // namespace

template <class Scalar>
void arap_range(const ArapBlock<Scalar>& block, std::int64_t begin, std::int64_t end, double* sums) {
  for (std::int64_t point = begin; point < end; point += lanes<Scalar>) {
    const std::int64_t valid = end - point;
    Pack33<Scalar> jacobian, gradient;
    load_jacobians(block.jets + 3 * block.count, block.count, point, valid, jacobian);
    RotationPack<Scalar> polar;
    closest_rotation<Scalar>(jacobian, polar);
    const Pack<Scalar> factor = load_factors(block.factors, point, valid);
    const Pack<Scalar> bending = factor * load_factors(block.bending_factors, point, valid);
    Pack<Scalar> stretch = {};
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        const Pack<Scalar> difference = jacobian[i][k] - polar.rotation[i][k];
        stretch += difference * difference;
        gradient[i][k] = (Scalar(2) * block.stretch_weight * factor) * difference;
      }
    sums[0] += sum_of_valid<Scalar>(stretch, valid);
    const double weighted = sum_of_valid<Scalar>(factor * stretch, valid);
    sums[2] += weighted;
    sums[3] += weighted;
    if (block.has_second) {
      Bend<Scalar> bend;
      evaluate_bend(block, point, valid, polar, bend);
      sums[1] += sum_of_valid<Scalar>(bend.value, valid);
      sums[2] += sum_of_valid<Scalar>(block.bending * bending * bend.value, valid);
      if (block.cotangents != nullptr && block.second_cotangents) {
        const Pack<Scalar> weight = block.bend_weight * bending;
        add_second_cotangents(block, point, valid, polar, bend, weight);
        add_bend_by_jacobian<Scalar>(jacobian, polar, bend, weight, gradient);
      }
    }
    if (block.cotangents == nullptr) continue;
    for (int k = 0; k < 3; ++k) {
      const Pack3<Scalar> column = {gradient[0][k], gradient[1][k], gradient[2][k]};
      add_points(block.cotangents + ((1 + k) * block.count + point) * 3, valid, column);
    }
  }
}
template void arap_range(const ArapBlock<float>&, std::int64_t, std::int64_t, double*);
template void arap_range(const ArapBlock<double>&, std::int64_t, std::int64_t, double*);

template <class Scalar>
void rotation_range(const Scalar* jacobians, std::int64_t count, std::int64_t begin, std::int64_t end,
                    Scalar* rotations) {
  for (std::int64_t point = begin; point < end; point += lanes<Scalar>) {
    const std::int64_t valid = end - point;
    Pack33<Scalar> jacobian;
    load_jacobians(jacobians, count, point, valid, jacobian);
    RotationPack<Scalar> polar;
    closest_rotation<Scalar>(jacobian, polar);
    for (int lane = 0; lane < lanes<Scalar> && lane < valid; ++lane)
      for (int k = 0; k < 3; ++k)
        for (int i = 0; i < 3; ++i)
          rotations[(k * count + point + lane) * 3 + i] = polar.rotation[i][k][lane];
  }
}
template void rotation_range(const float*, std::int64_t, std::int64_t, std::int64_t, float*);
template void rotation_range(const double*, std::int64_t, std::int64_t, std::int64_t, double*);

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

/// Signed singular values from K's eigenvalues, their pairwise sums; the smallest has the sign of det J.
template <class Scalar>
void distortion_range(const Scalar* jets, std::int64_t count, std::int64_t begin, std::int64_t end,
                      double* out) {
  for (std::int64_t point = begin; point < end; point += lanes<Scalar>) {
    const std::int64_t valid = end - point;
    Pack33<Scalar> jacobian;
    load_jacobians(jets + 3 * count, count, point, valid, jacobian);
    RotationPack<Scalar> polar;
    closest_rotation<Scalar>(jacobian, polar);
    const Pack<Scalar> total = Scalar(0.5) * (polar.sums[0] + polar.sums[1] + polar.sums[2]);
    Pack3<Scalar> sigma;
    for (int c = 0; c < 3; ++c) sigma[c] = total - polar.sums[c];
    for (int lane = 0; lane < lanes<Scalar> && lane < valid; ++lane) {
      double determinant = 1.0, high = 0.0, low = INFINITY;
      for (int c = 0; c < 3; ++c) {
        const double value = static_cast<double>(sigma[c][lane]), size = std::abs(value);
        determinant *= value;
        high = size > high ? size : high;
        low = size < low ? size : low;
      }
      out[0] = determinant < out[0] ? determinant : out[0];
      out[1] += determinant > 0.0 ? 0.0 : 1.0;
      out[2] = high > out[2] ? high : out[2];
      out[3] = low < out[3] ? low : out[3];
    }
  }
}
template void distortion_range(const float*, std::int64_t, std::int64_t, std::int64_t, double*);
template void distortion_range(const double*, std::int64_t, std::int64_t, std::int64_t, double*);

}  // namespace arapfields::SIMD_LEVEL
