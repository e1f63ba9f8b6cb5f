// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/frame_blend_kernel.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {

void blend_frames(const float* rows, const std::int64_t* start, const std::uint16_t* frames,
                  const float* weights, std::int64_t count, float* sums) {
  constexpr int packs = frame_length / lanes<float>;
  for (std::int64_t i = 0; i < count; ++i) {
    Pack<float> sum[packs] = {};
    for (std::int64_t e = start[i]; e < start[i + 1]; ++e) {
      const float* row = rows + frame_length * frames[e];
      for (int k = 0; k < packs; ++k) sum[k] += weights[e] * load(row + k * lanes<float>);
    }
    for (int k = 0; k < packs; ++k) store(sums + frame_length * i + k * lanes<float>, sum[k]);
  }
}

}  // namespace arapfields::SIMD_LEVEL
