// SPDX-License-Identifier: GPL-3.0-or-later
// Vectors as wide as the instruction set at hand, for SIMD sources alone (SIMD_LEVEL names their namespace).
#pragma once

#include <cmath>
#include <cstdint>
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

}  // namespace arapfields::SIMD_LEVEL
