// SPDX-License-Identifier: GPL-3.0-or-later
// Elementary functions for loops that the compiler is to vectorise: straight-line code, no calls, no
// branches.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

namespace arapfields::SIMD_LEVEL {

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

}  // namespace arapfields::SIMD_LEVEL
