// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <utility>

#include "core/errors.h"
#include "core/task.h"
#include "optimize/iteration.h"
#include "optimize/loop_result.h"
#include "optimize/optimizer.h"

namespace arapfields {

class Tensor;

/// The learning rate over its peak: it rises over the first iterations, is held for a part of the run, and
/// then falls, so that the last steps average out the noise of the batches.
struct RateSchedule {
  enum class Fall { linear, half_cosine };
  int warm_up = 0;  ///< iterations
  double hold_fraction = 0.5;
  double final_share = 0.05;  ///< what is left at the end
  Fall fall = Fall::half_cosine;

  /// Where `done` of the run, in [0, 1], has passed.
  double share(int iteration, double done) const;
};

struct LoopOptions {
  TrainingOptions training;  ///< the schedule follows the clock where a time budget is ahead
  OptimizerOptions optimizer;
  RateSchedule schedule;
  int steps = 1;               ///< of the optimizer that an iteration takes, at one rate
  IterationObserver observer;  ///< none: nothing is read for it
};

/// A loss of parameters, estimated at each iteration on a new random subset.
class LoopBody {
 public:
  virtual ~LoopBody() = default;
  /// Adds the gradient of the estimate to the gradient, which is zero before; returns the estimate, one
  /// number wherever it was computed. Asked once a step of the iteration.
  virtual Tensor accumulate(int iteration) = 0;
  /// Asked every ten iterations or so: whether the parameters as they are suffice.
  virtual bool is_good_enough() { return false; }
  /// After each iteration, of which `count` are done.
  virtual void iterated(int count) { static_cast<void>(count); }
  /// The weighted terms of the last estimate, for an observer.
  virtual std::vector<LossTerm> terms() const { return {}; }
  /// What a progress report says.
  virtual std::string message(int count, double loss, double seconds_left) const = 0;
};

/// A loop met NaN or infinity. The parameters are those of the last good state, to which `result` belongs.
class LoopDiverged : public Diverged {
 public:
  LoopDiverged(const std::string& what, LoopResult last) : Diverged(what), result(std::move(last)) {}
  LoopResult result;
};

/// Minimises. Losses that a device computes are read a few dozen at a time, so that the loop does not wait
/// for it. Throws LoopDiverged, which names the iteration where NaN or infinity was met and the one that was
/// kept.
LoopResult run_training(const Trainable& trained, LoopBody& body, const LoopOptions& options,
                        const Progress& progress);

}  // namespace arapfields
