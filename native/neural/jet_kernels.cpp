// SPDX-License-Identifier: GPL-3.0-or-later
// With s = φ'(z): h = φ, h_i = s z_i, h_ij = s z_ij + φ'' z_i z_j, φ'' = βs(1−s), φ''' = β φ''(1−2s).
#include "neural/jet_kernels.h"

#include "neural/vector_math.h"

namespace arapfields::SIMD_LEVEL {
namespace {

template <class Scalar, bool keep>
void activate_values(const ActivationBlock<Scalar>& b) {
  const Scalar scale = 1 / b.sharpness;
  for (std::int64_t p = 0; p < b.points; ++p) {
    Scalar* z = b.planes + p * b.width;
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

template <class Scalar, int columns, bool mixed, bool keep>
void activate_jets(const ActivationBlock<Scalar>& b) {
  const std::int64_t plane = b.points * b.width;
  const Scalar scale = 1 / b.sharpness;
  for (std::int64_t p = 0; p < b.points; ++p) {
    Scalar* z = b.planes + p * b.width;
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
      if constexpr (columns == 10) {
        const Scalar curve = b.sharpness * s * (1 - s);
        const Scalar c1 = curve * z1, c2 = curve * z2, c3 = curve * z3;
        h[w + 4 * plane] = s * z[w + 4 * plane] + c1 * z1;
        h[w + 5 * plane] = s * z[w + 5 * plane] + c2 * z2;
        h[w + 6 * plane] = s * z[w + 6 * plane] + c3 * z3;
        h[w + 7 * plane] = (mixed ? s * z[w + 7 * plane] : 0) + c1 * z2;
        h[w + 8 * plane] = (mixed ? s * z[w + 8 * plane] : 0) + c1 * z3;
        h[w + 9 * plane] = (mixed ? s * z[w + 9 * plane] : 0) + c2 * z3;
      }
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

template <class Scalar>
void back_first(const ActivationBlock<Scalar>& b, Scalar* cotangents, Scalar* bias_gradient) {
  const std::int64_t plane = b.points * b.width;
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* slope = b.slope + p * b.width;
    Scalar* z = b.planes + p * b.width;
    Scalar* g = cotangents + p * b.width;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      const Scalar s = slope[w], curve = b.sharpness * s * (1 - s);
      const Scalar z1 = z[w + plane], z2 = z[w + 2 * plane], z3 = z[w + 3 * plane];
      const Scalar g1 = g[w + plane], g2 = g[w + 2 * plane], g3 = g[w + 3 * plane];
      const Scalar g0 = s * g[w] + curve * (z1 * g1 + z2 * g2 + z3 * g3);
      g[w] = g0;
      g[w + plane] = s * g1;
      g[w + 2 * plane] = s * g2;
      g[w + 3 * plane] = s * g3;
      z[w + plane] = s * z1;
      z[w + 2 * plane] = s * z2;
      z[w + 3 * plane] = s * z3;
      bias_gradient[w] += g0;
    }
  }
}

template <class Scalar, bool mixed>
void back_second(const ActivationBlock<Scalar>& b, Scalar* cotangents, Scalar* bias_gradient) {
  const std::int64_t plane = b.points * b.width;
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* slope = b.slope + p * b.width;
    Scalar* z = b.planes + p * b.width;
    Scalar* g = cotangents + p * b.width;
#pragma GCC ivdep
    for (std::int64_t w = 0; w < b.width; ++w) {
      const Scalar s = slope[w], curve = b.sharpness * s * (1 - s), third = b.sharpness * curve * (1 - 2 * s);
      const Scalar z1 = z[w + plane], z2 = z[w + 2 * plane], z3 = z[w + 3 * plane];
      const Scalar z11 = z[w + 4 * plane], z22 = z[w + 5 * plane], z33 = z[w + 6 * plane];
      const Scalar z12 = mixed ? z[w + 7 * plane] : 0, z13 = mixed ? z[w + 8 * plane] : 0,
                   z23 = mixed ? z[w + 9 * plane] : 0;
      const Scalar g1 = g[w + plane], g2 = g[w + 2 * plane], g3 = g[w + 3 * plane];
      const Scalar g11 = g[w + 4 * plane], g22 = g[w + 5 * plane], g33 = g[w + 6 * plane];
      const Scalar g12 = g[w + 7 * plane], g13 = g[w + 8 * plane], g23 = g[w + 9 * plane];
      // m_i = Σ_j ĥ_ij z_j, the diagonal twice; then Σ_{i≤j} z_i z_j ĥ_ij = ½ Σ_i z_i m_i.
      const Scalar m1 = 2 * g11 * z1 + g12 * z2 + g13 * z3;
      const Scalar m2 = g12 * z1 + 2 * g22 * z2 + g23 * z3;
      const Scalar m3 = g13 * z1 + g23 * z2 + 2 * g33 * z3;
      const Scalar g0 = s * g[w] +
                        curve * (z1 * g1 + z2 * g2 + z3 * g3 + z11 * g11 + z22 * g22 + z33 * g33 + z12 * g12 +
                                 z13 * g13 + z23 * g23) +
                        third * (Scalar(0.5) * (z1 * m1 + z2 * m2 + z3 * m3));
      g[w] = g0;
      g[w + plane] = s * g1 + curve * m1;
      g[w + 2 * plane] = s * g2 + curve * m2;
      g[w + 3 * plane] = s * g3 + curve * m3;
      g[w + 4 * plane] = s * g11;
      g[w + 5 * plane] = s * g22;
      g[w + 6 * plane] = s * g33;
      if constexpr (mixed) {
        g[w + 7 * plane] = s * g12;
        g[w + 8 * plane] = s * g13;
        g[w + 9 * plane] = s * g23;
      }
      const Scalar c1 = curve * z1, c2 = curve * z2, c3 = curve * z3;
      z[w + plane] = s * z1;
      z[w + 2 * plane] = s * z2;
      z[w + 3 * plane] = s * z3;
      z[w + 4 * plane] = s * z11 + c1 * z1;
      z[w + 5 * plane] = s * z22 + c2 * z2;
      z[w + 6 * plane] = s * z33 + c3 * z3;
      z[w + 7 * plane] = s * z12 + c1 * z2;
      z[w + 8 * plane] = s * z13 + c1 * z3;
      z[w + 9 * plane] = s * z23 + c2 * z3;
      bias_gradient[w] += g0;
    }
  }
}

template <class Scalar, bool keep>
void activate_any(const ActivationBlock<Scalar>& b) {
  if (b.columns == 1) return activate_values<Scalar, keep>(b);
  if (b.columns == 4) return activate_jets<Scalar, 4, true, keep>(b);
  if (b.mixed) return activate_jets<Scalar, 10, true, keep>(b);
  activate_jets<Scalar, 10, false, keep>(b);
}

template <class Scalar>
void back_any(const ActivationBlock<Scalar>& b, Scalar* cotangents, Scalar* bias_gradient) {
  if (b.columns == 1) return back_values(b, cotangents, bias_gradient);
  if (b.columns == 4) return back_first(b, cotangents, bias_gradient);
  if (b.mixed) return back_second<Scalar, true>(b, cotangents, bias_gradient);
  back_second<Scalar, false>(b, cotangents, bias_gradient);
}

}  // namespace

void activate(const ActivationBlock<float>& b) {
  b.slope ? activate_any<float, true>(b) : activate_any<float, false>(b);
}
void activate(const ActivationBlock<double>& b) {
  b.slope ? activate_any<double, true>(b) : activate_any<double, false>(b);
}
void activate_back(const ActivationBlock<float>& b, float* cotangents, float* bias_gradient) {
  back_any(b, cotangents, bias_gradient);
}
void activate_back(const ActivationBlock<double>& b, double* cotangents, double* bias_gradient) {
  back_any(b, cotangents, bias_gradient);
}

}  // namespace arapfields::SIMD_LEVEL
