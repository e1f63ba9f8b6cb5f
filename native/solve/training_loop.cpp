// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/training_loop.h"

#include <ATen/ATen.h>

#include <cmath>
#include <cstdio>

#include "core/device.h"
#include "core/parallel.h"
#include "solve/optimizer.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

std::string message(const LoopOptions& options, int done, double loss, double left) {
  char text[160];
  std::snprintf(text, sizeof text, "%s: iteration %d of %d, loss %.5g, %.0f s left", options.stage.c_str(),
                done, options.training.iterations, loss, left);
  return text;
}

/// Losses stay where they were computed until a run of them is read at once: a read waits for the device.
class Losses {
 public:
  explicit Losses(const at::Tensor& like)
      : every_(on_aten_path(like) ? 25 : 1), run_(at::zeros({every_}, like.options().dtype(at::kDouble))) {}
  /// Whether as many as are read at once are there, the `iteration`-th included.
  bool due(int iteration) const { return (iteration + 1) % every_ == 0; }
  void keep(int iteration, const at::Tensor& loss) {
    run_.select(0, iteration % every_).copy_(loss);
    kept_ = iteration + 1;
  }
  /// Those not read yet: consume(iteration, loss).
  template <class Consume>
  void read(Consume&& consume) {
    const at::Tensor host = run_.to(at::kCPU);
    const double* values = host.const_data_ptr<double>();
    for (; read_ < kept_; ++read_) consume(read_, values[read_ % every_]);
  }

 private:
  int every_, kept_ = 0, read_ = 0;
  at::Tensor run_;
};

/// The parameters of a state whose loss was finite, refreshed now and then.
struct GoodState {
  at::Tensor parameters;
  int iteration = 0;
};

[[noreturn]] void diverge(TrainableField& field, const GoodState& good, const LoopOptions& options,
                          int iteration) {
  field.parameters().copy_(good.parameters);
  throw Diverged(options.stage + " left the finite numbers at iteration " + std::to_string(iteration) +
                 "; the state of iteration " + std::to_string(good.iteration) +
                 " was kept. A smaller learning_rate may help");
}

}  // namespace

LoopResult minimise(TrainableField& field, Objective& objective, const LoopOptions& options,
                    const Progress& progress, const LoopObserver& observer) {
  const ThreadScope scope;
  constexpr int snapshot_every = 10;
  const TrainingOptions& how = options.training;
  const Stopwatch watch;
  const int history_every = std::max(1, how.iterations / 200);
  LoopResult result;
  Random random(static_cast<std::uint64_t>(how.seed), 0x5eed);
  Optimizer optimizer(field, options);
  GoodState good{field.parameters().clone(), 0};
  Losses losses(field.parameters());
  double smooth = 0.0, reported = -1.0;
  const auto note = [&](int iteration, double loss) {
    if (!std::isfinite(loss)) diverge(field, good, options, iteration);
    smooth = iteration == 0 ? loss : 0.9 * smooth + 0.1 * loss;
    if (iteration % history_every == 0) result.history.emplace_back(iteration, loss);
  };
  for (int iteration = 0; iteration < how.iterations; ++iteration) {
    progress.check();
    const double elapsed = watch.seconds();
    double done = static_cast<double>(iteration) / how.iterations;
    if (how.time_budget > 0.0) {
      if (elapsed >= how.time_budget) {
        result.out_of_time = true;
        break;
      }
      done = std::max(done, elapsed / how.time_budget);
    }
    field.gradient().zero_();
    losses.keep(iteration, objective.accumulate(field, random));
    if (losses.due(iteration)) {
      losses.read(note);
      if (iteration - good.iteration >= snapshot_every) {
        good.parameters.copy_(field.parameters());
        good.iteration = iteration;
      }
    }
    optimizer.step(optimizer.rate(done));
    result.iterations = iteration + 1;
    if (elapsed - reported > 0.1) {
      reported = elapsed;
      const double left = elapsed * (1.0 - done) / std::max(done, 1e-3);
      progress.report(done, message(options, iteration + 1, smooth, done > 0.0 ? left : 0.0));
    }
    if (observer) observer(iteration + 1);
  }
  losses.read(note);
  if (!at::isfinite(field.parameters()).all().item<bool>()) diverge(field, good, options, result.iterations);
  result.seconds = watch.seconds();
  progress.report(1.0);
  return result;
}

}  // namespace arapfields
