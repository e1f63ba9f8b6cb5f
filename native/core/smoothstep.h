// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

namespace arapfields {

/// 0 at `none`, 1 at `all`, 3 t² − 2 t³ between, and the same as at these beyond them; either may be larger.
inline double smoothstep(double none, double all, double x) {
  const double t = std::clamp((x - none) / (all - none), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

}  // namespace arapfields
