// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
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
  double loss = 0.0;            ///< the estimate that this iteration lowered
  std::vector<LossTerm> terms;  ///< the parts of the loss, whose sum it is
  double seconds = 0.0;         ///< since the loop began
};

/// Called after each iteration, on the thread that called: false ends the loop with what was reached
/// (StopReason::observer). What it throws comes through to the caller. On a device, each call waits for it.
using IterationObserver = std::function<bool(const Iteration&)>;

}  // namespace arapfields
