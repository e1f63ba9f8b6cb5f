// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstdint>

// Vectors as wide as the instruction set at hand, for SIMD sources alone (SIMD_LEVEL names their namespace).
#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(ARAPFIELDS_NEON)  // the level's own definition: every 64-bit ARM compiler has __ARM_NEON
#include <arm_neon.h>
#endif

namespace arapfields::SIMD_LEVEL {

#if defined(__AVX512F__)
constexpr int pack_bytes = 64;
#elif defined(__AVX2__)
constexpr int pack_bytes = 32;
#else
constexpr int pack_bytes = 16;
#endif

template <class Scalar>
struct PackTraits;
template <>
struct PackTraits<float> {
  typedef float Pack __attribute__((vector_size(pack_bytes)));
  typedef std::int32_t Bits __attribute__((vector_size(pack_bytes)));
  static constexpr float round_shift = 12582912.0f, lowest_exponent = -87.0f, highest_exponent = 88.0f;
  static constexpr float ln2_high = 0.693359375f, ln2_low = -2.12194440e-4f;
  static constexpr std::int32_t mantissa_bits = 23, one = 0x3f800000;
  static constexpr int exp_terms = 8;
};
template <>
struct PackTraits<double> {
  typedef double Pack __attribute__((vector_size(pack_bytes)));
  typedef std::int64_t Bits __attribute__((vector_size(pack_bytes)));
  static constexpr double round_shift = 6755399441055744.0, lowest_exponent = -708.0,
                          highest_exponent = 709.0;
  static constexpr double ln2_high = 6.93147180369123816490e-01, ln2_low = 1.90821492927058770002e-10;
  static constexpr std::int64_t mantissa_bits = 52, one = 0x3ff0000000000000;
  static constexpr int exp_terms = 14;
};

/// Arithmetic, comparison and `mask ? a : b` act on each lane; a scalar operand is broadcast.
template <class Scalar>
using Pack = typename PackTraits<Scalar>::Pack;
template <class Scalar>
constexpr int lanes = pack_bytes / static_cast<int>(sizeof(Scalar));

template <class Scalar>
inline Pack<Scalar> broadcast(Scalar value) {
  return Pack<Scalar>{} + value;
}

template <class Scalar>
inline Pack<Scalar> load(const Scalar* from) {
  Pack<Scalar> result;
  __builtin_memcpy(&result, from, sizeof result);
  return result;
}

template <class Scalar>
inline void store(Scalar* to, Pack<Scalar> value) {
  __builtin_memcpy(to, &value, sizeof value);
}

// The masked forms: GCC 12 warns of the plain ones' own undefined operand.
inline Pack<float> square_root(Pack<float> x) {
#if defined(__AVX512F__)
  return (Pack<float>)_mm512_maskz_sqrt_ps(0xffff, (__m512)x);
#elif defined(__AVX2__)
  return (Pack<float>)_mm256_sqrt_ps((__m256)x);
#elif defined(ARAPFIELDS_NEON)
  return (Pack<float>)vsqrtq_f32((float32x4_t)x);
#else
  for (int i = 0; i < lanes<float>; ++i) x[i] = std::sqrt(x[i]);
  return x;
#endif
}

inline Pack<double> square_root(Pack<double> x) {
#if defined(__AVX512F__)
  return (Pack<double>)_mm512_maskz_sqrt_pd(0xff, (__m512d)x);
#elif defined(__AVX2__)
  return (Pack<double>)_mm256_sqrt_pd((__m256d)x);
#elif defined(ARAPFIELDS_NEON)
  return (Pack<double>)vsqrtq_f64((float64x2_t)x);
#else
  for (int i = 0; i < lanes<double>; ++i) x[i] = std::sqrt(x[i]);
  return x;
#endif
}

template <class Scalar>
inline Scalar sum_of_lanes(Pack<Scalar> x) {
  Scalar result = 0;
  for (int i = 0; i < lanes<Scalar>; ++i) result += x[i];
  return result;
}

// e^x for packs, in SIMD sources.

template <class Scalar>
constexpr Scalar inverse_factorial(int n) {
  double result = 1;
  for (int k = 2; k <= n; ++k) result /= k;
  return static_cast<Scalar>(result);
}

/// e^x to about one unit in the last place: x = n ln 2 + r, |r| ≤ ln 2 / 2, the series in r, times 2^n.
/// Arguments are clamped to where the result is a normal number.
template <class Scalar>
inline Pack<Scalar> exponential(Pack<Scalar> x) {
  using Traits = PackTraits<Scalar>;
  const Pack<Scalar> low = broadcast(Traits::lowest_exponent), high = broadcast(Traits::highest_exponent);
  x = x < low ? low : x;
  x = x > high ? high : x;
  const Pack<Scalar> shifted = x * Scalar(1.4426950408889634) + Traits::round_shift;
  const Pack<Scalar> n = shifted - Traits::round_shift;
  const Pack<Scalar> r = (x - n * Traits::ln2_high) - n * Traits::ln2_low;
  Pack<Scalar> series = broadcast(inverse_factorial<Scalar>(Traits::exp_terms - 1));
#pragma GCC unroll 16
  for (int term = Traits::exp_terms - 2; term >= 0; --term)
    series = series * r + inverse_factorial<Scalar>(term);
  const typename Traits::Bits bits = ((typename Traits::Bits)shifted << Traits::mantissa_bits) + Traits::one;
  return series * (Pack<Scalar>)bits;
}

// Points into packs and back, in SIMD sources.

#if defined(ARAPFIELDS_NEON)
/// As many points as there are lanes, by the instruction that deinterleaves triples.
inline void load_interleaved(const float* from, Pack<float> (&out)[3]) {
  const float32x4x3_t split = vld3q_f32(from);
  for (int c = 0; c < 3; ++c) out[c] = (Pack<float>)split.val[c];
}
inline void load_interleaved(const double* from, Pack<double> (&out)[3]) {
  const float64x2x3_t split = vld3q_f64(from);
  for (int c = 0; c < 3; ++c) out[c] = (Pack<double>)split.val[c];
}
#endif

/// Three components of `lanes` points from (n,3) rows starting at `from`; lanes past `valid` repeat the last.
template <class Scalar>
inline void load_points(const Scalar* from, std::int64_t valid, Pack<Scalar> (&out)[3]) {
#if defined(ARAPFIELDS_NEON)
  if (valid >= lanes<Scalar>) return load_interleaved(from, out);
#endif
  Scalar split[3][lanes<Scalar>];
  const int last = valid < lanes<Scalar> ? static_cast<int>(valid) - 1 : lanes<Scalar> - 1;
  for (int i = 0; i < lanes<Scalar>; ++i)
    for (int c = 0; c < 3; ++c) split[c][i] = from[3 * (i < last ? i : last) + c];
  for (int c = 0; c < 3; ++c) out[c] = load(split[c]);
}

/// Adds to the rows of the first `valid` lanes.
template <class Scalar>
inline void add_points(Scalar* to, std::int64_t valid, const Pack<Scalar> (&values)[3]) {
  const int count = valid < lanes<Scalar> ? static_cast<int>(valid) : lanes<Scalar>;
  for (int i = 0; i < count; ++i)
    for (int c = 0; c < 3; ++c) to[3 * i + c] += values[c][i];
}

}  // namespace arapfields::SIMD_LEVEL
