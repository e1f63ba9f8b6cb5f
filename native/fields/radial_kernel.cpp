// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_kernel.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

constexpr int block_size = 16;

/// φ(s) = (1 − s/κ)₊^κ and, from order 1 and 2, twice φ' and four times φ'' by |x|² (g = 1/r²).
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
template <int order, bool embedded, class Scalar>
inline void jet_of(const RadialBlock<Scalar>& block, int offset, std::int64_t m, Pack<Scalar>* out) {
  constexpr int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
  const Scalar* center = block.centers + center_stride * m;
  // Halves of the squared distance's derivatives: arm d, and what the embedding adds to it and to the
  // identity.
  Pack<Scalar> d[3], q[3];
  for (int k = 0; k < 3; ++k) d[k] = load(block.points + k * block_size + offset) - center[k];
  Pack<Scalar> square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  const auto embedding = [&](int row) { return load(block.embedding + row * block_size + offset); };
  if constexpr (embedded) {
    for (int k = 0; k < 3; ++k) q[k] = embedding(k) - center[4 + k];
    square += q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
  }
  const Bump<Scalar> b = bump<order, Scalar>(square, center[3]);
  out[0] = b.value;
  if constexpr (embedded && order >= 1)
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) d[i] += q[k] * embedding(3 + 3 * i + k);
  if constexpr (order >= 1)
    for (int k = 0; k < 3; ++k) out[1 + k] = b.slope * d[k];
  if constexpr (order >= 2) {
    Pack<Scalar> curved[3];
    for (int k = 0; k < 3; ++k) curved[k] = b.curvature * d[k];
    for (int c = 0; c < 6; ++c) {
      out[4 + c] = curved[pairs[c][0]] * d[pairs[c][1]];
      if constexpr (embedded) {
        Pack<Scalar> more = embedding(30 + c);
        for (int k = 0; k < 3; ++k) more += q[k] * embedding(12 + 3 * c + k);
        out[4 + c] += b.slope * (c < 3 ? more + Scalar(1) : more);
      } else if (c < 3) {
        out[4 + c] += b.slope;
      }
    }
  }
}

template <int order>
constexpr int columns_of = order == 0   ? 1
                           : order == 1 ? 4
                                        : 10;

template <int order, bool embedded, class Scalar>
void forward(const RadialBlock<Scalar>& block, const Scalar* coefficients, Scalar* jets) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += lanes<Scalar>) {
    Pack<Scalar> sums[columns][3] = {};
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      const std::int64_t m = block.active[a];
      Pack<Scalar> basis[columns];
      jet_of<order, embedded>(block, offset, m, basis);
      const Scalar* c = coefficients + 3 * m;
      for (int column = 0; column < columns; ++column)
        for (int i = 0; i < 3; ++i) sums[column][i] += basis[column] * c[i];
    }
    for (int column = 0; column < columns; ++column)
      for (int i = 0; i < 3; ++i) store(jets + (column * 3 + i) * block_size + offset, sums[column][i]);
  }
}

template <int order, bool embedded, class Scalar>
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
      jet_of<order, embedded>(block, offset, m, basis);
      Scalar* sums = gradient + m * 3 * radial_lanes;
      for (int i = 0; i < 3; ++i) {
        Pack<Scalar> sum = load(sums + i * radial_lanes);
        for (int column = 0; column < columns; ++column) sum += basis[column] * cotangent[column][i];
        store(sums + i * radial_lanes, sum);
      }
    }
  }
}

template <int order, bool embedded>
void rows_of(const RadialBlock<double>& block, double* rows) {
  constexpr int columns = columns_of<order>;
  for (int offset = 0; offset < block_size; offset += lanes<double>)
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      Pack<double> basis[columns];
      jet_of<order, embedded>(block, offset, block.active[a], basis);
      for (int column = 0; column < columns; ++column)
        store(rows + (a * columns + column) * block_size + offset, basis[column]);
    }
}

/// Calls body.template operator()<order, embedded>() for the block and the number of columns at hand.
template <class Scalar, class Body>
void specialise(const RadialBlock<Scalar>& block, int columns, Body&& body) {
  const bool embedded = block.embedding != nullptr;
  if (columns == 1)
    return embedded ? body.template operator()<0, true>() : body.template operator()<0, false>();
  if (columns == 4)
    return embedded ? body.template operator()<1, true>() : body.template operator()<1, false>();
  embedded ? body.template operator()<2, true>() : body.template operator()<2, false>();
}

}  // namespace

void radial_rows(const RadialBlock<double>& block, int columns, double* rows) {
  specialise(block, columns, [&]<int order, bool embedded>() { rows_of<order, embedded>(block, rows); });
}

std::int64_t radial_active(const double* center, const double* ball_radius, const double* centers,
                           std::int64_t count, std::int32_t* active) {
  std::int64_t active_count = 0;
  for (std::int64_t m = 0; m < count; ++m) {
    const double* b = centers + center_stride * m;
    double square = 0;
    for (int part = 0; part < 2; ++part) {
      const double x = b[4 * part] - center[3 * part], y = b[4 * part + 1] - center[3 * part + 1],
                   z = b[4 * part + 2] - center[3 * part + 2];
      const double gap = std::sqrt(x * x + y * y + z * z) - ball_radius[part];
      square += gap > 0 ? gap * gap : 0;
    }
    active[active_count] = static_cast<std::int32_t>(m);
    active_count += square * b[3] < radial_power ? 1 : 0;
  }
  return active_count;
}

double farthest_update(const double* points, const double* weights, std::int64_t count, const double* from,
                       double* distance) {
  using P = Pack<double>;
  P worst = {};
  for (std::int64_t i = 0; i < count; i += lanes<double>) {
    const P x = load(points + i) - from[0], y = load(points + count + i) - from[1],
            z = load(points + 2 * count + i) - from[2];
    const P square = load(weights + i) * (x * x + y * y + z * z), before = load(distance + i);
    const P now = square < before ? square : before;
    store(distance + i, now);
    worst = now > worst ? now : worst;
  }
  double result = 0;
  for (int i = 0; i < lanes<double>; ++i) result = worst[i] > result ? worst[i] : result;
  return result;
}

template <class Scalar>
void radial_forward(const RadialBlock<Scalar>& block, const Scalar* coefficients, int columns, Scalar* jets) {
  specialise(block, columns,
             [&]<int order, bool embedded>() { forward<order, embedded>(block, coefficients, jets); });
}
template void radial_forward(const RadialBlock<float>&, const float*, int, float*);
template void radial_forward(const RadialBlock<double>&, const double*, int, double*);

template <class Scalar>
void radial_backward(const RadialBlock<Scalar>& block, const Scalar* cotangents, int columns, Scalar* sums) {
  specialise(block, columns,
             [&]<int order, bool embedded>() { backward<order, embedded>(block, cotangents, sums); });
}
template void radial_backward(const RadialBlock<float>&, const float*, int, float*);
template void radial_backward(const RadialBlock<double>&, const double*, int, double*);

}  // namespace arapfields::SIMD_LEVEL
