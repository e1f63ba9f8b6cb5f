// SPDX-License-Identifier: GPL-3.0-or-later
// e^x for packs, in SIMD sources.
#pragma once

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {

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

}  // namespace arapfields::SIMD_LEVEL
