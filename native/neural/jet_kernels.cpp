// SPDX-License-Identifier: GPL-3.0-or-later
// With s = φ'(z): h = φ, h_i = s z_i, φ'' = βs(1−s).
#include "neural/jet_kernels.h"

#include "neural/vector_math.h"

namespace arapfields::SIMD_LEVEL {
namespace {

template <class Scalar, bool keep>
void activate_values(const ActivationBlock<Scalar>& b) {
  const Scalar scale = 1 / b.sharpness;
  for (std::int64_t p = 0; p < b.points; ++p) {
    Scalar* z = b.activations + p * b.width;
    Scalar* slope = keep ? b.slope + p * b.width : nullptr;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      Scalar value, s;
      softplus(b.sharpness * (z[w] + b.bias[w]), value, s);
      z[w] = value * scale;
      if constexpr (keep) slope[w] = s;
    }
  }
}

template <class Scalar, bool keep>
void activate_jets(const ActivationBlock<Scalar>& b) {
  const std::int64_t plane = b.points * b.width;
  const Scalar scale = 1 / b.sharpness;
  for (std::int64_t p = 0; p < b.points; ++p) {
    Scalar* z = b.activations + p * b.width;
    Scalar* h = b.jets + p * b.width;
    Scalar* slope = keep ? b.slope + p * b.width : nullptr;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      Scalar value, s;
      softplus(b.sharpness * (z[w] + b.bias[w]), value, s);
      value *= scale;
      if constexpr (keep) z[w] = value, slope[w] = s;
      h[w] = value;
      const Scalar z1 = z[w + plane], z2 = z[w + 2 * plane], z3 = z[w + 3 * plane];
      h[w + plane] = s * z1;
      h[w + 2 * plane] = s * z2;
      h[w + 3 * plane] = s * z3;
    }
  }
}

template <class Scalar>
void back_values(const ActivationBlock<Scalar>& b, Scalar* cotangents, Scalar* bias_gradient) {
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* slope = b.slope + p * b.width;
    Scalar* g = cotangents + p * b.width;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      g[w] *= slope[w];
      bias_gradient[w] += g[w];
    }
  }
}

template <class Scalar, bool with_partial>
void back_first(const ActivationBlock<Scalar>& b, const Scalar* partial, Scalar* cotangents,
                Scalar* bias_gradient) {
  const std::int64_t plane = b.points * b.width;
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* slope = b.slope + p * b.width;
    Scalar* z = b.activations + p * b.width;
    Scalar* g = cotangents + p * b.width;
    const Scalar* more = with_partial ? partial + p * b.width : nullptr;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      const Scalar s = slope[w], curve = b.sharpness * s * (1 - s);
      const Scalar z1 = z[w + plane], z2 = z[w + 2 * plane], z3 = z[w + 3 * plane];
      const Scalar g1 = g[w + plane], g2 = g[w + 2 * plane], g3 = g[w + 3 * plane];
      Scalar g0 = s * g[w] + curve * (z1 * g1 + z2 * g2 + z3 * g3);
      if constexpr (with_partial) g0 += more[w];
      g[w] = g0;
      g[w + plane] = s * g1 + (with_partial ? more[w + plane] : 0);
      g[w + 2 * plane] = s * g2 + (with_partial ? more[w + 2 * plane] : 0);
      g[w + 3 * plane] = s * g3 + (with_partial ? more[w + 3 * plane] : 0);
      z[w + plane] = s * z1;
      z[w + 2 * plane] = s * z2;
      z[w + 3 * plane] = s * z3;
      bias_gradient[w] += g0;
    }
  }
}

template <class Scalar, bool keep>
void activate_any(const ActivationBlock<Scalar>& b) {
  if (b.columns == 1) return activate_values<Scalar, keep>(b);
  activate_jets<Scalar, keep>(b);
}

}  // namespace

template <class Scalar>
void activate_back(const ActivationBlock<Scalar>& b, const Scalar* partial, Scalar* cotangents,
                   Scalar* bias_gradient) {
  if (b.columns == 1) return back_values(b, cotangents, bias_gradient);
  if (partial != nullptr) return back_first<Scalar, true>(b, partial, cotangents, bias_gradient);
  back_first<Scalar, false>(b, partial, cotangents, bias_gradient);
}
template void activate_back(const ActivationBlock<float>&, const float*, float*, float*);
template void activate_back(const ActivationBlock<double>&, const double*, double*, double*);

template <class Scalar>
void activate(const ActivationBlock<Scalar>& b) {
  b.slope ? activate_any<Scalar, true>(b) : activate_any<Scalar, false>(b);
}
template void activate(const ActivationBlock<float>&);
template void activate(const ActivationBlock<double>&);

}  // namespace arapfields::SIMD_LEVEL
