// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/tall_product_kernel.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

constexpr int strip_width = 64;

}  // namespace

template <class Scalar>
void tall_product_rows(const TallBlock<Scalar>& a, std::int64_t begin, std::int64_t end, const Scalar* b,
                       Scalar* out) {
  for (std::int64_t row = begin; row < end; row += 4) {
    const int count = end - row < 4 ? static_cast<int>(end - row) : 4;
    const Scalar* from[4];
    for (int r = 0; r < 4; ++r) from[r] = a.values + (row + (r < count ? r : 0)) * a.stride;
    const std::int64_t row_end = a.lower && row + count < a.stride ? row + count : a.stride;
    Pack<Scalar> sums[4][3] = {};
    for (std::int64_t j = 0; j < row_end; j += lanes<Scalar>) {
      Pack<Scalar> columns[3];
      for (int k = 0; k < 3; ++k) columns[k] = load(b + k * a.stride + j);
      for (int r = 0; r < 4; ++r) {
        const Pack<Scalar> x = load(from[r] + j);
        for (int k = 0; k < 3; ++k) sums[r][k] += x * columns[k];
      }
    }
    for (int r = 0; r < count; ++r)
      for (int k = 0; k < 3; ++k) out[3 * (row + r) + k] = sum_of_lanes<Scalar>(sums[r][k]);
  }
}
template void tall_product_rows(const TallBlock<float>&, std::int64_t, std::int64_t, const float*, float*);
template void tall_product_rows(const TallBlock<double>&, std::int64_t, std::int64_t, const double*, double*);

template <class Scalar>
void tall_product_strip(const TallBlock<Scalar>& a, std::int64_t first, std::int64_t rows, const Scalar* b,
                        Scalar* out) {
  constexpr int packs = 4;
  for (int part = 0; part < strip_width; part += packs * lanes<Scalar>) {
    constexpr int used = packs * lanes<Scalar> < strip_width ? packs : strip_width / lanes<Scalar>;
    const std::int64_t column = first + part;
    Pack<Scalar> sums[used][3] = {};
    for (std::int64_t row = a.lower ? column : 0; row < rows; ++row) {
      const Scalar* from = a.values + row * a.stride + column;
      const Scalar* factors = b + 3 * row;
      for (int p = 0; p < used; ++p) {
        const Pack<Scalar> x = load(from + p * lanes<Scalar>);
        for (int k = 0; k < 3; ++k) sums[p][k] += x * factors[k];
      }
    }
    for (int p = 0; p < used; ++p)
      for (int k = 0; k < 3; ++k) store(out + k * a.stride + column + p * lanes<Scalar>, sums[p][k]);
  }
}
template void tall_product_strip(const TallBlock<float>&, std::int64_t, std::int64_t, const float*, float*);
template void tall_product_strip(const TallBlock<double>&, std::int64_t, std::int64_t, const double*,
                                 double*);

}  // namespace arapfields::SIMD_LEVEL
