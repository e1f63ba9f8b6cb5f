// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/training_loop.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/parallel.h"
#include "core/task.h"
#include "tensors/device.h"
#include "tensors/operations.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

/// Losses on the device where they were computed, read several at a time, since a read waits for the device.
class Losses {
 public:
  explicit Losses(const Tensor& like)
      : every_(on_device_path(like) ? 25 : 1), run_(upload(zeros({every_}, NumberType::float64), like)) {}
  /// Whether the buffer is full after this iteration.
  bool due(int iteration) const { return (iteration + 1) % every_ == 0; }
  void keep(int iteration, const Tensor& loss) {
    run_.select(0, iteration % every_).assign(loss);
    kept_ = iteration + 1;
  }
  /// Calls consume(iteration, loss) for all losses not read yet.
  template <class Consume>
  void read(Consume&& consume) {
    const Tensor host = run_.to_host();
    const double* values = host.data<double>();
    for (; read_ < kept_; ++read_) consume(read_, values[read_ % every_]);
  }

 private:
  int every_, kept_ = 0, read_ = 0;
  Tensor run_;
};

/// The state of one training run.
class Run {
 public:
  Run(const Trainable& trained, LoopBody& body, const LoopOptions& options, const Progress& progress)
      : trained_(trained),
        body_(body),
        options_(options),
        progress_(progress),
        optimizer_(trained, options.training, options.optimizer),
        losses_(trained.parameters),
        start_(trained.parameters.clone()),
        good_(start_.clone()) {}

  LoopResult operator()() {
    const CancelScope scope(progress_);
    int& iteration = result_.iterations;
    for (; iteration < options_.training.iterations; ++iteration) {
      progress_.check();
      const double elapsed = watch_.seconds(), done = done_after(elapsed);
      if (options_.training.time_budget > 0.0 && elapsed >= options_.training.time_budget) {
        result_.stopped_by = StopReason::time_budget;
        break;
      }
      const double share = options_.schedule.share(iteration, done);
      for (int step = 1; step < options_.steps; ++step) {
        trained_.gradient.set_zero();
        body_.accumulate(iteration);
        optimizer_.step(share);
        progress_.check();
      }
      trained_.gradient.set_zero();
      losses_.keep(iteration, body_.accumulate(iteration));
      if (losses_.due(iteration) && look() && body_.is_good_enough()) {
        result_.stopped_by = StopReason::target;
        break;
      }
      optimizer_.step(share);
      report(elapsed, done);
      body_.iterated(iteration + 1);
      if (options_.observer && !observed(iteration)) {
        ++iteration;
        result_.stopped_by = StopReason::observer;
        break;
      }
    }
    read_losses();
    if (!all_finite(trained_.parameters) || !body_.is_finite()) diverge(iteration);
    result_.seconds = watch_.seconds();
    progress_.report(1.0);
    return result_;
  }

 private:
  double done_after(double elapsed) const {
    const double done = static_cast<double>(result_.iterations) / options_.training.iterations;
    return options_.training.time_budget > 0.0 ? std::max(done, elapsed / options_.training.time_budget)
                                               : done;
  }

  void read_losses() {
    const int history_every = std::max(1, options_.training.iterations / 200);
    losses_.read([&](int iteration, double loss) {
      if (!std::isfinite(loss)) diverge(iteration);
      last_ = loss;
      smooth_ = iteration == 0 ? loss : 0.9 * smooth_ + 0.1 * loss;
      if (iteration % history_every == 0) result_.history.emplace_back(iteration, loss);
    });
  }

  /// Reads the losses; every ten iterations stores the parameters as the last finite state. Whether it did.
  bool look() {
    constexpr int every = 10;
    read_losses();
    if (result_.iterations - good_iteration_ < every) return false;
    good_.assign(trained_.parameters);
    good_iteration_ = result_.iterations;
    return true;
  }

  /// Calls the observer; returns whether the loop continues.
  bool observed(int iteration) {
    read_losses();
    return options_.observer({iteration + 1, last_, body_.terms(), watch_.seconds()});
  }

  void report(double elapsed, double done) {
    constexpr double pause = 0.1;
    if (elapsed - reported_ <= pause) return;
    reported_ = elapsed;
    const double left = done > 0.0 ? elapsed * (1.0 - done) / std::max(done, 1e-3) : 0.0;
    progress_.report(done, body_.message(result_.iterations + 1, smooth_, left));
  }

  [[noreturn]] void diverge(int iteration) {
    trained_.parameters.assign(good_);
    if (good_iteration_ > 0 && !body_.is_finite()) {
      trained_.parameters.assign(start_);
      good_iteration_ = 0;
    }
    result_.stopped_by = StopReason::divergence;
    result_.iterations = good_iteration_;
    result_.seconds = watch_.seconds();
    std::erase_if(result_.history, [&](const auto& entry) { return entry.first > good_iteration_; });
    throw LoopDiverged("NaN or infinity at iteration " + std::to_string(iteration) +
                           "; the state of iteration " + std::to_string(good_iteration_) +
                           " was kept. A smaller learning_rate may help",
                       result_);
  }

  Trainable trained_;
  LoopBody& body_;
  const LoopOptions& options_;
  const Progress& progress_;
  const Stopwatch watch_;
  Optimizer optimizer_;
  Losses losses_;
  Tensor start_, good_;
  int good_iteration_ = 0;
  double last_ = 0.0, smooth_ = 0.0, reported_ = -1.0;
  LoopResult result_;
};

}  // namespace

double RateSchedule::share(int iteration, double done) const {
  const double rising = warm_up > 0 ? std::min(1.0, (iteration + 1.0) / warm_up) : 1.0;
  const double fallen = std::clamp((done - hold_fraction) / std::max(1e-9, 1.0 - hold_fraction), 0.0, 1.0);
  const double left = fall == Fall::linear ? 1.0 - fallen : 0.5 * (1.0 + std::cos(std::numbers::pi * fallen));
  return rising * (final_share + (1.0 - final_share) * left);
}

LoopResult run_training(const Trainable& trained, LoopBody& body, const LoopOptions& options,
                        const Progress& progress) {
  const ThreadScope scope;
  return Run(trained, body, options, progress)();
}

}  // namespace arapfields
