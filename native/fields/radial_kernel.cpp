// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_kernel.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

using P = Pack<double>;
constexpr int width = lanes<double>;
constexpr int block_size = 16;

/// φ(s) = (1 − s/κ)₊^κ and, where asked for, twice φ' and four times φ'' by |x|² (g = 1/r²).
struct Bump {
  P value, slope, curvature;
};

template <int order>
inline Bump bump(P square, double g) {
  const P zero = {};
  P base = 1.0 - square * (g / radial_power);
  base = base > zero ? base : zero;
  const P second = base * base * base * base;
  static_assert(radial_power == 6);
  Bump result;
  result.value = second * base * base;
  if constexpr (order >= 1) result.slope = (-2.0 * g) * (second * base);
  if constexpr (order >= 2) result.curvature = (4.0 * g * g * (radial_power - 1) / radial_power) * second;
  return result;
}

struct Arm {
  P d[3], square;
};

inline Arm arm(const RadialBlock& block, int offset, const double* center) {
  Arm result;
  for (int k = 0; k < 3; ++k) result.d[k] = load(block.points + k * block_size + offset) - center[k];
  result.square = result.d[0] * result.d[0] + result.d[1] * result.d[1] + result.d[2] * result.d[2];
  return result;
}

/// The ten (four, one) jet columns of one bump.
template <int order>
inline void jet_of(const Arm& a, double g, P* out) {
  const Bump b = bump<order>(a.square, g);
  out[0] = b.value;
  if constexpr (order >= 1)
    for (int k = 0; k < 3; ++k) out[1 + k] = b.slope * a.d[k];
  if constexpr (order >= 2) {
    P curved[3];
    for (int k = 0; k < 3; ++k) curved[k] = b.curvature * a.d[k];
    for (int k = 0; k < 3; ++k) out[4 + k] = curved[k] * a.d[k] + b.slope;
    out[7] = curved[0] * a.d[1];
    out[8] = curved[0] * a.d[2];
    out[9] = curved[1] * a.d[2];
  }
}

template <int order>
constexpr int columns_of = order == 0   ? 1
                           : order == 1 ? 4
                                        : 10;

template <int order>
void forward(const RadialBlock& block, const double* coefficients, double* jets) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += width) {
    P sums[columns][3] = {};
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      const std::int64_t m = block.active[a];
      const double* center = block.bumps + 4 * m;
      P basis[columns];
      jet_of<order>(arm(block, offset, center), center[3], basis);
      const double* c = coefficients + 3 * m;
      for (int column = 0; column < columns; ++column)
        for (int i = 0; i < 3; ++i) sums[column][i] += basis[column] * c[i];
    }
    for (int column = 0; column < columns; ++column)
      for (int i = 0; i < 3; ++i) store(jets + (column * 3 + i) * block_size + offset, sums[column][i]);
  }
}

template <int order>
void backward(const RadialBlock& block, const double* cotangents, double* gradient) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += width) {
    P cotangent[columns][3];
    for (int column = 0; column < columns; ++column)
      for (int i = 0; i < 3; ++i)
        cotangent[column][i] = load(cotangents + (column * 3 + i) * block_size + offset);
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      const std::int64_t m = block.active[a];
      const double* center = block.bumps + 4 * m;
      P basis[columns];
      jet_of<order>(arm(block, offset, center), center[3], basis);
      double* sums = gradient + m * 3 * radial_lanes;
      for (int i = 0; i < 3; ++i) {
        P sum = load(sums + i * radial_lanes);
        for (int column = 0; column < columns; ++column) sum += basis[column] * cotangent[column][i];
        store(sums + i * radial_lanes, sum);
      }
    }
  }
}

template <int order>
void rows_of(const RadialBlock& block, double* rows) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += width)
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      const double* center = block.bumps + 4 * static_cast<std::int64_t>(block.active[a]);
      P basis[columns];
      jet_of<order>(arm(block, offset, center), center[3], basis);
      for (int column = 0; column < columns; ++column)
        store(rows + (a * columns + column) * block_size + offset, basis[column]);
    }
}

}  // namespace

/// Jets (columns, 3, 16) of the bumps' part.
void radial_forward(const RadialBlock& block, const double* coefficients, int columns, double* jets) {
  if (columns == 1) return forward<0>(block, coefficients, jets);
  if (columns == 4) return forward<1>(block, coefficients, jets);
  forward<2>(block, coefficients, jets);
}

/// Cotangents (columns, 3, 16).
void radial_backward(const RadialBlock& block, const double* cotangents, int columns, double* gradient) {
  if (columns == 1) return backward<0>(block, cotangents, gradient);
  if (columns == 4) return backward<1>(block, cotangents, gradient);
  backward<2>(block, cotangents, gradient);
}

/// Jets of each active bump: (active, columns, 16).
void radial_rows(const RadialBlock& block, int columns, double* rows) {
  if (columns == 1) return rows_of<0>(block, rows);
  if (columns == 4) return rows_of<1>(block, rows);
  rows_of<2>(block, rows);
}

/// Lists the bumps whose support meets the ball of radius `reach` around `center`.
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

/// distance ← min(distance, |point − from|²) for points (3, stride), of which the first `count` (a multiple
/// of 16) are used; returns the largest.
double farthest_update(const double* points, std::int64_t stride, std::int64_t count, const double* from,
                       double* distance) {
  P worst = {};
  for (std::int64_t i = 0; i < count; i += width) {
    const P x = load(points + i) - from[0], y = load(points + stride + i) - from[1],
            z = load(points + 2 * stride + i) - from[2];
    const P square = x * x + y * y + z * z, before = load(distance + i);
    const P now = square < before ? square : before;
    store(distance + i, now);
    worst = now > worst ? now : worst;
  }
  double result = 0;
  for (int i = 0; i < width; ++i) result = worst[i] > result ? worst[i] : result;
  return result;
}

}  // namespace arapfields::SIMD_LEVEL
