// SPDX-License-Identifier: GPL-3.0-or-later
// Positional encoding: the base angle's sine and cosine in double, the octaves above it by doubling the
// angle, which loses one bit an octave and so leaves float results exact to rounding up to 2^24 and more.
#include <cmath>

#include "neural/jet_kernels.h"

namespace arapfields::SIMD_LEVEL {

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

}  // namespace arapfields::SIMD_LEVEL
