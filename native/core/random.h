// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/types.h"

namespace arapfields {

/// Counter-based random numbers: the i-th draw of a stream depends on (seed, stream, i) alone. Results depend
/// neither on the standard library nor on how work is split over threads.
class ARAPFIELDS_EXPORT Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0);
  std::uint64_t bits();
  /// Uniform in [0,1).
  double uniform();
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform in {0, …, count−1}.
  Index below(Index count);
  double normal();
  /// Uniform on the unit sphere.
  Vec3 direction();

 private:
  std::uint64_t key_;
  std::uint64_t counter_ = 0;
};

}  // namespace arapfields
