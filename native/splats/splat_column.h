// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace arapfields {

/// One quantity of splats: the number of splat i at rest is rest[i * rest_stride].
struct SplatColumn {
  const float* rest;
  std::int64_t rest_stride;
  float* change;  ///< change[i * change_stride] becomes what a motion adds to it
  std::int64_t change_stride;
};

}  // namespace arapfields
