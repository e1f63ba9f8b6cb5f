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

/// A center's displacement d = x − p at some lanes, its displacement q = ψ(x) − ψ(p) in the embedding, and
/// the squared distance |d|² + |q|².
template <bool embedded, class Scalar>
struct Separation {
  Pack<Scalar> d[3], q[3], square;

  Separation(const RadialBlock<Scalar>& block, int offset, const Scalar* center) {
    for (int k = 0; k < 3; ++k) d[k] = load(block.points + k * block_size + offset) - center[k];
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    if constexpr (embedded) {
      for (int k = 0; k < 3; ++k) q[k] = load(block.embedding + k * block_size + offset) - center[4 + k];
      square += q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
    }
  }
};

/// Derivatives of ψ at some lanes: ∂_j ψ_k, column c of the second ones, and the products of the first.
template <class Scalar>
struct Embedding {
  const Scalar* rows;
  int offset;
  Pack<Scalar> first(int j, int k) const { return load(rows + (3 + 3 * j + k) * block_size + offset); }
  Pack<Scalar> second(int c, int k) const { return load(rows + (12 + 3 * c + k) * block_size + offset); }
  Pack<Scalar> product(int c) const { return load(rows + (30 + c) * block_size + offset); }
};

/// Half the gradient of the squared distance.
template <bool embedded, class Scalar>
inline void half_gradient(const Separation<embedded, Scalar>& s, const Embedding<Scalar>& psi,
                          Pack<Scalar>* out) {
  for (int i = 0; i < 3; ++i) {
    out[i] = s.d[i];
    if constexpr (embedded)
      for (int k = 0; k < 3; ++k) out[i] += s.q[k] * psi.first(i, k);
  }
}

constexpr int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};

/// The ten (four, one) jet columns of bump m at some lanes of the block.
template <int order, bool embedded, class Scalar>
inline void jet_of(const RadialBlock<Scalar>& block, int offset, std::int64_t m, Pack<Scalar>* out) {
  const Scalar* center = block.centers + center_stride * m;
  const Separation<embedded, Scalar> s(block, offset, center);
  const Bump<Scalar> b = bump<order, Scalar>(s.square, center[3]);
  const Embedding<Scalar> psi{block.embedding, offset};
  out[0] = b.value;
  if constexpr (order >= 1) {
    Pack<Scalar> half[3];
    half_gradient(s, psi, half);
    for (int k = 0; k < 3; ++k) out[1 + k] = b.slope * half[k];
    if constexpr (order >= 2) {
      Pack<Scalar> curved[3];
      for (int k = 0; k < 3; ++k) curved[k] = b.curvature * half[k];
      for (int c = 0; c < 6; ++c) {
        out[4 + c] = curved[pairs[c][0]] * half[pairs[c][1]];
        if constexpr (embedded) {
          Pack<Scalar> more = psi.product(c);
          for (int k = 0; k < 3; ++k) more += s.q[k] * psi.second(c, k);
          out[4 + c] += b.slope * (c < 3 ? more + Scalar(1) : more);
        } else if (c < 3) {
          out[4 + c] += b.slope;
        }
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

/// Cotangents of one component of f at some lanes, collected as coefficients of the terms that depend on a
/// center: φ, φ' times d, 1 and q, φ'' times the products of the half gradient.
template <int order, bool embedded, class Scalar>
struct CenterCotangents {
  Pack<Scalar> value, d[3], one, q[3], products[6];

  CenterCotangents(const Embedding<Scalar>& psi, const Scalar* cotangents) {
    const auto column = [&](int c) { return load(cotangents + 3 * c * block_size); };
    value = column(0);
    if constexpr (order >= 1)
      for (int k = 0; k < 3; ++k) {
        d[k] = column(1 + k);
        if constexpr (embedded) {
          q[k] = Pack<Scalar>{};
          for (int j = 0; j < 3; ++j) q[k] += column(1 + j) * psi.first(j, k);
        }
      }
    if constexpr (order >= 2) {
      one = column(4) + column(5) + column(6);
      for (int c = 0; c < 6; ++c) {
        products[c] = column(4 + c);
        if constexpr (embedded) {
          one += products[c] * psi.product(c);
          for (int k = 0; k < 3; ++k) q[k] += products[c] * psi.second(c, k);
        }
      }
    }
  }
};

template <int order, bool embedded, class Scalar>
void backward(const RadialBlock<Scalar>& block, const Scalar* cotangents, Scalar* gradient) {
  using P = Pack<Scalar>;
  using Cotangents = CenterCotangents<order, embedded, Scalar>;
  for (int offset = 0; offset < block_size; offset += lanes<Scalar>) {
    const Embedding<Scalar> psi{block.embedding, offset};
    const auto of = [&](int i) { return Cotangents(psi, cotangents + i * block_size + offset); };
    const Cotangents components[3] = {of(0), of(1), of(2)};
    for (std::int64_t a = 0; a < block.active_count; ++a) {
      const std::int64_t m = block.active[a];
      const Scalar* center = block.centers + center_stride * m;
      const Separation<embedded, Scalar> s(block, offset, center);
      const Bump<Scalar> b = bump<order, Scalar>(s.square, center[3]);
      P products[6];
      if constexpr (order >= 2) {
        P half[3];
        half_gradient(s, psi, half);
        for (int c = 0; c < 6; ++c) products[c] = half[pairs[c][0]] * half[pairs[c][1]];
      }
      Scalar* sums = gradient + m * 3 * radial_lanes;
      for (int i = 0; i < 3; ++i) {
        const Cotangents& to = components[i];
        P sum = load(sums + i * radial_lanes) + b.value * to.value;
        if constexpr (order >= 1) {
          P by_slope = s.d[0] * to.d[0] + s.d[1] * to.d[1] + s.d[2] * to.d[2];
          if constexpr (order >= 2) by_slope += to.one;
          if constexpr (embedded) by_slope += s.q[0] * to.q[0] + s.q[1] * to.q[1] + s.q[2] * to.q[2];
          sum += b.slope * by_slope;
        }
        if constexpr (order >= 2) {
          P by_curvature = products[0] * to.products[0];
          for (int c = 1; c < 6; ++c) by_curvature += products[c] * to.products[c];
          sum += b.curvature * by_curvature;
        }
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

double farthest_update(const double* points, int dimensions, const double* weights, std::int64_t count,
                       const double* from, double* distance) {
  using P = Pack<double>;
  P worst = {};
  for (std::int64_t i = 0; i < count; i += lanes<double>) {
    P sum = {};
    for (int k = 0; k < dimensions; ++k) {
      const P way = load(points + k * count + i) - from[k];
      sum += way * way;
    }
    const P square = load(weights + i) * sum, before = load(distance + i);
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
