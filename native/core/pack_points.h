// SPDX-License-Identifier: GPL-3.0-or-later
// Points into packs and back, in SIMD sources.
#pragma once

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {

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
