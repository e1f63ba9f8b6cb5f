// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_kernel.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

constexpr int block_size = 16;

/// φ(s) = (1 − s/κ)₊^κ and, where asked for, twice φ' and four times φ'' by |x|² (g = 1/r²).
template <class Scalar>
struct Bump {
  Pack<Scalar> value, slope, curvature;
};

template <int order, class Scalar>
inline Bump<Scalar> bump(Pack<Scalar> square, Scalar g) {
  using P = Pack<Scalar>;
  static_assert(radial_power == 6);
  const P zero = {};
  P base = Scalar(1) - square * (g / Scalar(radial_power));
  base = base > zero ? base : zero;
  const P second = base * base, fourth = second * second;
  Bump<Scalar> result;
  result.value = fourth * second;
  if constexpr (order >= 1) result.slope = (Scalar(-2) * g) * (fourth * base);
  if constexpr (order >= 2)
    result.curvature = (Scalar(4) * g * g * Scalar(radial_power - 1) / radial_power) * fourth;
  return result;
}

/// The ten (four, one) jet columns of bump m at some lanes of the block.
template <int order, class Scalar>
inline void jet_of(const RadialBlock<Scalar>& block, int offset, std::int64_t m, Pack<Scalar>* out) {
  const Scalar* center = block.bumps + 4 * m;
  Pack<Scalar> d[3];
  for (int k = 0; k < 3; ++k) d[k] = load(block.points + k * block_size + offset) - center[k];
  const Bump<Scalar> b = bump<order, Scalar>(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], center[3]);
  out[0] = b.value;
  if constexpr (order >= 1)
    for (int k = 0; k < 3; ++k) out[1 + k] = b.slope * d[k];
  if constexpr (order >= 2) {
    Pack<Scalar> curved[3];
    for (int k = 0; k < 3; ++k) curved[k] = b.curvature * d[k];
    for (int k = 0; k < 3; ++k) out[4 + k] = curved[k] * d[k] + b.slope;
    out[7] = curved[0] * d[1];
    out[8] = curved[0] * d[2];
    out[9] = curved[1] * d[2];
  }
}

template <int order>
constexpr int columns_of = order == 0   ? 1
                           : order == 1 ? 4
                                        : 10;

template <int order, class Scalar>
void forward(const RadialBlock<Scalar>& block, const Scalar* coefficients, Scalar* jets) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += lanes<Scalar>) {
    Pack<Scalar> sums[columns][3] = {};
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      const std::int64_t m = block.active[a];
      Pack<Scalar> basis[columns];
      jet_of<order>(block, offset, m, basis);
      const Scalar* c = coefficients + 3 * m;
      for (int column = 0; column < columns; ++column)
        for (int i = 0; i < 3; ++i) sums[column][i] += basis[column] * c[i];
    }
    for (int column = 0; column < columns; ++column)
      for (int i = 0; i < 3; ++i) store(jets + (column * 3 + i) * block_size + offset, sums[column][i]);
  }
}

template <int order, class Scalar>
void backward(const RadialBlock<Scalar>& block, const Scalar* cotangents, Scalar* gradient) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += lanes<Scalar>) {
    Pack<Scalar> cotangent[columns][3];
    for (int column = 0; column < columns; ++column)
      for (int i = 0; i < 3; ++i)
        cotangent[column][i] = load(cotangents + (column * 3 + i) * block_size + offset);
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      const std::int64_t m = block.active[a];
      Pack<Scalar> basis[columns];
      jet_of<order>(block, offset, m, basis);
      Scalar* sums = gradient + m * 3 * radial_lanes;
      for (int i = 0; i < 3; ++i) {
        Pack<Scalar> sum = load(sums + i * radial_lanes);
        for (int column = 0; column < columns; ++column) sum += basis[column] * cotangent[column][i];
        store(sums + i * radial_lanes, sum);
      }
    }
  }
}

template <int order>
void rows_of(const RadialBlock<double>& block, double* rows) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += lanes<double>)
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      Pack<double> basis[columns];
      jet_of<order>(block, offset, block.active[a], basis);
      for (int column = 0; column < columns; ++column)
        store(rows + (a * columns + column) * block_size + offset, basis[column]);
    }
}

template <class Scalar>
void forward_any(const RadialBlock<Scalar>& block, const Scalar* coefficients, int columns, Scalar* jets) {
  if (columns == 1) return forward<0>(block, coefficients, jets);
  if (columns == 4) return forward<1>(block, coefficients, jets);
  forward<2>(block, coefficients, jets);
}

template <class Scalar>
void backward_any(const RadialBlock<Scalar>& block, const Scalar* cotangents, int columns, Scalar* sums) {
  if (columns == 1) return backward<0>(block, cotangents, sums);
  if (columns == 4) return backward<1>(block, cotangents, sums);
  backward<2>(block, cotangents, sums);
}

}  // namespace

void radial_forward(const RadialBlock<float>& block, const float* coefficients, int columns, float* jets) {
  forward_any(block, coefficients, columns, jets);
}
void radial_forward(const RadialBlock<double>& block, const double* coefficients, int columns, double* jets) {
  forward_any(block, coefficients, columns, jets);
}
void radial_backward(const RadialBlock<float>& block, const float* cotangents, int columns, float* sums) {
  backward_any(block, cotangents, columns, sums);
}
void radial_backward(const RadialBlock<double>& block, const double* cotangents, int columns, double* sums) {
  backward_any(block, cotangents, columns, sums);
}

void radial_rows(const RadialBlock<double>& block, int columns, double* rows) {
  if (columns == 1) return rows_of<0>(block, rows);
  if (columns == 4) return rows_of<1>(block, rows);
  rows_of<2>(block, rows);
}

std::int64_t radial_active(const double* center, double reach, const double* bumps, std::int64_t count,
                           std::int32_t* active) {
  std::int64_t found = 0;
  for (std::int64_t m = 0; m < count; ++m) {
    const double* b = bumps + 4 * m;
    const double x = b[0] - center[0], y = b[1] - center[1], z = b[2] - center[2];
    const double limit = reach + std::sqrt(radial_power / b[3]);
    active[found] = static_cast<std::int32_t>(m);
    found += x * x + y * y + z * z < limit * limit ? 1 : 0;
  }
  return found;
}

double farthest_update(const double* points, std::int64_t stride, std::int64_t count, const double* from,
                       double* distance) {
  using P = Pack<double>;
  P worst = {};
  for (std::int64_t i = 0; i < count; i += lanes<double>) {
    const P x = load(points + i) - from[0], y = load(points + stride + i) - from[1],
            z = load(points + 2 * stride + i) - from[2];
    const P square = x * x + y * y + z * z, before = load(distance + i);
    const P now = square < before ? square : before;
    store(distance + i, now);
    worst = now > worst ? now : worst;
  }
  double result = 0;
  for (int i = 0; i < lanes<double>; ++i) result = worst[i] > result ? worst[i] : result;
  return result;
}

}  // namespace arapfields::SIMD_LEVEL
