// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/kernels.h"

#include <cmath>
#include <cstdint>
#include <cstring>

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {

// Elementary functions for loops that the compiler is to vectorise: straight-line code, no calls, no
// branches.

inline __attribute__((always_inline)) float exp_of_negative(float x) {
  // Cody–Waite reduction to [-ln2/2, ln2/2], then a polynomial; 2^n through the exponent's bits.
  x = x < -87.0f ? -87.0f : x;
  const float n = (x * 1.44269504f + 12582912.0f) - 12582912.0f;
  const float r = (x - n * 0.693359375f) - n * -2.12194440e-4f;
  float p = 1.9875691500e-4f;
  p = p * r + 1.3981999507e-3f;
  p = p * r + 8.3334519073e-3f;
  p = p * r + 4.1665795894e-2f;
  p = p * r + 1.6666665459e-1f;
  p = p * r + 5.0000001201e-1f;
  p = p * (r * r) + r + 1.0f;
  const std::int32_t bits = (static_cast<std::int32_t>(n) + 127) << 23;
  float scale;
  std::memcpy(&scale, &bits, sizeof scale);
  return p * scale;
}

/// φ = log(1 + exp(t)) and φ' = 1/(1 + exp(-t)).
inline __attribute__((always_inline)) void softplus(float t, float& value, float& slope) {
  const float positive = t > 0.0f ? t : 0.0f;
  const float e = exp_of_negative(t > 0.0f ? -t : t);
  // One division for both: log1p(e) = 2 artanh(e / (2 + e)).
  const float reciprocal = 1.0f / ((1.0f + e) * (2.0f + e));
  const float s = (2.0f + e) * reciprocal;
  const float w = e * (1.0f + e) * reciprocal, q = w * w;
  float p = 2.0f / 15.0f;
  p = p * q + 2.0f / 13.0f;
  p = p * q + 2.0f / 11.0f;
  p = p * q + 2.0f / 9.0f;
  p = p * q + 2.0f / 7.0f;
  p = p * q + 2.0f / 5.0f;
  p = p * q + 2.0f / 3.0f;
  p = p * q + 2.0f;
  value = positive + p * w;
  slope = t > 0.0f ? s : e * s;
}

inline void softplus(double t, double& value, double& slope) {
  const double e = std::exp(t > 0.0 ? -t : t);
  value = (t > 0.0 ? t : 0.0) + std::log1p(e);
  slope = (t > 0.0 ? 1.0 : e) / (1.0 + e);
}

// Positional encoding: the base angle's sine and cosine in double, the octaves above it by doubling the
// angle, which loses one bit an octave and so leaves float results exact to rounding up to 2^24 and more.

template <class Scalar>
void encode(const EncodingBlock<Scalar>& b) {
  const std::int64_t row = 6 * b.octaves;
  for (std::int64_t i = 0; i < 3 * b.count; ++i) {
    const double angle = b.frequency * static_cast<double>(b.points[i]);
    double c = std::cos(angle), s = std::sin(angle), f = b.frequency;
    std::int64_t at = (i / 3) * row + (i % 3) * 2 * b.octaves;
    for (int k = 0; k < b.octaves; ++k, at += 2, f *= 2) {
      b.value[at] = static_cast<Scalar>(c);
      b.value[at + 1] = static_cast<Scalar>(s);
      if (b.first != nullptr) {
        b.first[at] = static_cast<Scalar>(-f * s);
        b.first[at + 1] = static_cast<Scalar>(f * c);
      }
      if (b.second != nullptr) {
        b.second[at] = static_cast<Scalar>(-f * f * c);
        b.second[at + 1] = static_cast<Scalar>(-f * f * s);
      }
      const double twice = 2 * s * c;
      c = (c - s) * (c + s);
      s = twice;
    }
  }
}

template void encode(const EncodingBlock<float>&);
template void encode(const EncodingBlock<double>&);

// With s = φ'(z): h = φ, h_i = s z_i, φ'' = βs(1−s).

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

namespace {

// V is a pack, or one number for the units that are left over.
template <class V, class Scalar>
inline V read(const Scalar* from) {
  V value;
  __builtin_memcpy(&value, from, sizeof value);
  return value;
}

template <class V, class Scalar>
inline void write(Scalar* to, V value) {
  __builtin_memcpy(to, &value, sizeof value);
}

/// One point, units w to w + (size of V) of the outputs first to first + count.
template <class V, int count, class Scalar>
inline void adjoint_units(const AdjointBlock<Scalar>& b, std::int64_t p, std::int64_t w, int first,
                          V (&sum)[count][6]) {
  const std::int64_t plane = b.points * b.width, at = p * b.width + w;
  const V s = read<V>(b.slope + at), curve = b.sharpness * s * (1 - s);
  const V z1 = read<V>(b.activations + plane + at), z2 = read<V>(b.activations + 2 * plane + at),
          z3 = read<V>(b.activations + 3 * plane + at);
  const V c1 = curve * z1, c2 = curve * z2, c3 = curve * z3;
  const V bent[6] = {c1 * z1, c2 * z2, c3 * z3, c1 * z2, c1 * z3, c2 * z3};
  for (int o = 0; o < count; ++o) {
    const V q = read<V>(b.adjoints + (first + o) * (b.shared ? b.width : plane) + (b.shared ? w : at));
    write(b.below + (first + o) * plane + at, V(s * q));
    for (int c = 0; c < 6; ++c) sum[o][c] += q * bent[c];
  }
}

template <int count, class Scalar>
void adjoint_outputs(const AdjointBlock<Scalar>& b, int first, Scalar* second) {
  for (std::int64_t p = 0; p < b.points; ++p) {
    Pack<Scalar> wide[count][6] = {};
    Scalar rest[count][6] = {};
    std::int64_t w = 0;
    for (; w + lanes<Scalar> <= b.width; w += lanes<Scalar>) adjoint_units(b, p, w, first, wide);
    for (; w < b.width; ++w) adjoint_units(b, p, w, first, rest);
    for (int c = 0; c < 6; ++c)
      for (int o = 0; o < count; ++o)
        second[(p * 6 + c) * b.outputs + first + o] += sum_of_lanes<Scalar>(wide[o][c]) + rest[o][c];
  }
}

/// `d`: the cotangents (6, outputs) of this point's second derivatives.
template <class V, class Scalar>
inline void back_units(const AdjointBlock<Scalar>& b, std::int64_t p, std::int64_t w, const Scalar* d,
                       Scalar* cotangents, Scalar* partial) {
  const std::int64_t plane = b.points * b.width, at = p * b.width + w;
  const V s = read<V>(b.slope + at), curve = b.sharpness * s * (1 - s);
  const V steeper = b.sharpness * (1 - 2 * s);  // φ''' = steeper φ''
  const V z1 = read<V>(b.activations + plane + at), z2 = read<V>(b.activations + 2 * plane + at),
          z3 = read<V>(b.activations + 3 * plane + at);
  V to_value = {}, to_1 = {}, to_2 = {}, to_3 = {};
  for (int o = 0; o < b.outputs; ++o) {
    const Scalar d11 = d[o], d22 = d[b.outputs + o], d33 = d[2 * b.outputs + o];
    const Scalar d12 = d[3 * b.outputs + o], d13 = d[4 * b.outputs + o], d23 = d[5 * b.outputs + o];
    const V q = read<V>(b.adjoints + o * (b.shared ? b.width : plane) + (b.shared ? w : at));
    const V g = read<V>(cotangents + o * plane + at);
    // m_i = Σ_j ĥ_ij ∂_j z, the diagonal twice; then Σ_{i≤j} ĥ_ij ∂_i z ∂_j z = ½ Σ_i ∂_i z m_i.
    const V m1 = 2 * d11 * z1 + d12 * z2 + d13 * z3;
    const V m2 = d12 * z1 + 2 * d22 * z2 + d23 * z3;
    const V m3 = d13 * z1 + d23 * z2 + 2 * d33 * z3;
    const V bent = Scalar(0.5) * (z1 * m1 + z2 * m2 + z3 * m3);
    to_value += q * (g + steeper * bent);
    to_1 += q * m1, to_2 += q * m2, to_3 += q * m3;
    write(cotangents + o * plane + at, V(s * g + curve * bent));
    write(b.below + o * plane + at, V(s * q));
  }
  write(partial + at, V(curve * to_value));
  write(partial + plane + at, V(curve * to_1));
  write(partial + 2 * plane + at, V(curve * to_2));
  write(partial + 3 * plane + at, V(curve * to_3));
}

}  // namespace

template <class Scalar>
void adjoint(const AdjointBlock<Scalar>& b, Scalar* second) {
  if (b.outputs == 3) return adjoint_outputs<3>(b, 0, second);
  for (int o = 0; o < b.outputs; ++o) adjoint_outputs<1>(b, o, second);
}
template void adjoint(const AdjointBlock<float>&, float*);
template void adjoint(const AdjointBlock<double>&, double*);

template <class Scalar>
void adjoint_back(const AdjointBlock<Scalar>& b, const Scalar* second, Scalar* cotangents, Scalar* partial) {
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* d = second + p * 6 * b.outputs;
    std::int64_t w = 0;
    for (; w + lanes<Scalar> <= b.width; w += lanes<Scalar>)
      back_units<Pack<Scalar>>(b, p, w, d, cotangents, partial);
    for (; w < b.width; ++w) back_units<Scalar>(b, p, w, d, cotangents, partial);
  }
}
template void adjoint_back(const AdjointBlock<float>&, const float*, float*, float*);
template void adjoint_back(const AdjointBlock<double>&, const double*, double*, double*);

// With s = φ'(z), c = φ'' = βs(1−s) and φ''' = βc(1−2s): h_i = s z_i, h_ij = s z_ij + c z_i z_j.

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
