// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

namespace arapfields {

/// Why a loop ended.
enum class StopReason { iterations, time_budget, target, observer, divergence };

struct LoopResult {
  int iterations = 0;
  double seconds = 0.0;
  StopReason stopped_by = StopReason::iterations;
  std::vector<std::pair<int, double>> history;  ///< (iteration, loss), at most a few hundred entries
};

}  // namespace arapfields
