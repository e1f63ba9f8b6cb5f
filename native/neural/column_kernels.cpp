// SPDX-License-Identifier: GPL-3.0-or-later
// With s = φ'(z), c = φ'' = βs(1−s) and φ''' = βc(1−2s): h_i = s z_i, h_ij = s z_ij + c z_i z_j.
#include "neural/column_kernels.h"

#include "neural/vector_math.h"

namespace arapfields::SIMD_LEVEL {
namespace {

template <class Scalar, int columns, bool keep>
void forward(const ColumnBlock<Scalar>& b) {
  const std::int64_t plane = b.points * b.width;
  const Scalar scale = 1 / b.sharpness;
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* z = b.z + p * b.width;
    Scalar* h = b.h + p * b.width;
    Scalar* slope = keep ? b.slope + p * b.width : nullptr;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      Scalar value, s;
      softplus(b.sharpness * (z[w] + b.bias[w]), value, s);
      h[w] = value * scale;
      if constexpr (keep) slope[w] = s;
      if constexpr (columns > 1) {
        const Scalar z1 = z[w + plane], z2 = z[w + 2 * plane];
        h[w + plane] = s * z1;
        h[w + 2 * plane] = s * z2;
        if constexpr (columns > 3) {
          const Scalar c = b.sharpness * s * (1 - s);
          h[w + 3 * plane] = s * z[w + 3 * plane] + c * z1 * z1;
          h[w + 4 * plane] = s * z[w + 4 * plane] + c * z2 * z2;
          h[w + 5 * plane] = s * z[w + 5 * plane] + c * z1 * z2;
        }
      }
    }
  }
}

template <class Scalar, int columns>
void back(const ColumnBlock<Scalar>& b, Scalar* cotangents, Scalar* bias_gradient) {
  const std::int64_t plane = b.points * b.width;
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* slope = b.slope + p * b.width;
    const Scalar* z = b.z + p * b.width;
    Scalar* g = cotangents + p * b.width;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      const Scalar s = slope[w];
      Scalar g0 = s * g[w];
      if constexpr (columns > 1) {
        const Scalar c = b.sharpness * s * (1 - s);
        const Scalar z1 = z[w + plane], z2 = z[w + 2 * plane];
        const Scalar g1 = g[w + plane], g2 = g[w + 2 * plane];
        Scalar d1 = s * g1, d2 = s * g2;
        Scalar by_curve = z1 * g1 + z2 * g2;
        if constexpr (columns > 3) {
          const Scalar g11 = g[w + 3 * plane], g22 = g[w + 4 * plane], g12 = g[w + 5 * plane];
          const Scalar a1 = g11 * z1, a2 = g22 * z2;
          d1 += c * (2 * a1 + g12 * z2);
          d2 += c * (2 * a2 + g12 * z1);
          by_curve += g11 * z[w + 3 * plane] + g22 * z[w + 4 * plane] + g12 * z[w + 5 * plane];
          g0 += b.sharpness * c * (1 - 2 * s) * (a1 * z1 + a2 * z2 + g12 * z1 * z2);
          g[w + 3 * plane] = s * g11;
          g[w + 4 * plane] = s * g22;
          g[w + 5 * plane] = s * g12;
        }
        g0 += c * by_curve;
        g[w + plane] = d1;
        g[w + 2 * plane] = d2;
      }
      g[w] = g0;
      bias_gradient[w] += g0;
    }
  }
}

template <class Scalar, bool keep>
void forward_any(const ColumnBlock<Scalar>& b) {
  if (b.columns == 1) return forward<Scalar, 1, keep>(b);
  if (b.columns == 3) return forward<Scalar, 3, keep>(b);
  forward<Scalar, 6, keep>(b);
}

}  // namespace

template <class Scalar>
void activate_columns_back(const ColumnBlock<Scalar>& b, Scalar* cotangents, Scalar* bias_gradient) {
  if (b.columns == 1) return back<Scalar, 1>(b, cotangents, bias_gradient);
  if (b.columns == 3) return back<Scalar, 3>(b, cotangents, bias_gradient);
  back<Scalar, 6>(b, cotangents, bias_gradient);
}
template void activate_columns_back(const ColumnBlock<float>&, float*, float*);
template void activate_columns_back(const ColumnBlock<double>&, double*, double*);

template <class Scalar>
void activate_columns(const ColumnBlock<Scalar>& b) {
  b.slope ? forward_any<Scalar, true>(b) : forward_any<Scalar, false>(b);
}
template void activate_columns(const ColumnBlock<float>&);
template void activate_columns(const ColumnBlock<double>&);

}  // namespace arapfields::SIMD_LEVEL
