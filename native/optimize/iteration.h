// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace arapfields {

/// A weighted part of a loss.
struct LossTerm {
  std::string name;
  double value = 0.0;
};

/// The argument of an observer, after each iteration.
struct Iteration {
  int number = 0;               ///< iterations done, from 1
  double loss = 0.0;            ///< estimate before this iteration's steps
  std::vector<LossTerm> terms;  ///< the parts of the loss, whose sum it is
  double seconds = 0.0;         ///< since the loop began
};

/// Called after each iteration, on the caller's thread: false ends the loop with the current parameters
/// (StopReason::observer). Exceptions are passed on. With a GPU, each call waits for the device.
using IterationObserver = std::function<bool(const Iteration&)>;

/// Why a loop ended.
enum class StopReason { iterations, time_budget, target, observer, divergence };

struct LoopResult {
  int iterations = 0;
  double seconds = 0.0;
  StopReason stopped_by = StopReason::iterations;
  std::vector<std::pair<int, double>> history;  ///< (iteration, loss), at most a few hundred entries
};

}  // namespace arapfields
