// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "core/types.h"

namespace arapfields {

class Tensor;

struct AdamOptions {
  double beta1 = 0.9;   ///< β1, of the gradient's running mean
  double beta2 = 0.99;  ///< β2, of the running mean of its squares
  double epsilon = 1e-8;
};

/// Adam (Kingma and Ba 2015, algorithm 1, with both bias corrections) on a flat contiguous vector of
/// parameters, in one pass over memory; float or double, on any device.
class AdamStep {
 public:
  /// Keeps nothing of `parameters` but its size, dtype and device.
  explicit AdamStep(const Tensor& parameters, const AdamOptions& options = {});
  ~AdamStep();
  AdamStep(AdamStep&&) noexcept;
  AdamStep& operator=(AdamStep&&) noexcept;

  /// parameters −= learning_rate · (mean / √square), both corrected.
  void step(Tensor& parameters, const Tensor& gradient, double learning_rate);
  /// The same for entries [begin, end) alone; the caller counts steps by next_step().
  void step_range(Tensor& parameters, const Tensor& gradient, double learning_rate, Index begin, Index end);
  void next_step();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
