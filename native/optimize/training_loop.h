// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <utility>

#include "core/errors.h"
#include "core/task.h"
#include "optimize/iteration.h"
#include "optimize/optimizer.h"

namespace arapfields {

class Tensor;

/// The learning rate relative to its peak: a linear warm-up, a constant part, and a decay, so that the last
/// steps average out the noise of the batches.
struct RateSchedule {
  enum class Fall { linear, half_cosine };
  int warm_up = 0;  ///< iterations
  double hold_fraction = 0.5;
  double final_share = 0.05;  ///< relative rate at the end
  Fall fall = Fall::half_cosine;

  /// The relative rate at the fraction `done` of the run, in [0, 1].
  double share(int iteration, double done) const;
};

struct LoopOptions {
  TrainingOptions training;  ///< with a time budget, the schedule follows the clock if that is ahead
  OptimizerOptions optimizer;
  RateSchedule schedule;
  int steps = 1;               ///< optimizer steps in an iteration, with the same rate
  IterationObserver observer;  ///< none: losses are read from a device less often
};

/// A loss of parameters, estimated at each iteration on a new random subset.
class LoopBody {
 public:
  virtual ~LoopBody() = default;
  /// Adds the gradient of the estimate to the gradient, which is zero before; returns the estimate, a scalar
  /// on the device where it was computed. Called for each step of an iteration.
  virtual Tensor accumulate(int iteration) = 0;
  /// Whether what the current parameters give is finite wherever it is used: parameters and the losses of
  /// subsets may be where values or derivatives elsewhere are not. Called for what the loop is to return.
  virtual bool is_finite() = 0;
  /// Whether the current parameters suffice; called about every ten iterations.
  virtual bool is_good_enough() { return false; }
  /// After each iteration, of which `count` are done.
  virtual void iterated(int count) { static_cast<void>(count); }
  /// The weighted terms of the last estimate, for an observer.
  virtual std::vector<LossTerm> terms() const { return {}; }
  /// The message of a progress report.
  virtual std::string message(int count, double loss, double seconds_left) const = 0;
};

/// A loss, or what the last step gave, was NaN or infinite. The parameters are those of the last finite
/// state, as is `result`.
class LoopDiverged : public Diverged {
 public:
  LoopDiverged(const std::string& what, LoopResult last) : Diverged(what), result(std::move(last)) {}
  LoopResult result;
};

/// Runs the training loop. Losses on a device are read a few dozen at a time, so that the host does not wait
/// for it. Throws LoopDiverged, which names the iteration with NaN or infinity and the one that was kept.
LoopResult run_training(const Trainable& trained, LoopBody& body, const LoopOptions& options,
                        const Progress& progress);

}  // namespace arapfields
