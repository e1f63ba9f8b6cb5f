// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/adam_loop.h"

#include <ATen/ATen.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace arapfields {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

double rate(const LoopOptions& options, double done, int iteration) {
  const double warm = options.warm_up > 0 ? std::min(1.0, (iteration + 1.0) / options.warm_up) : 1.0;
  const double falling = std::clamp((done - options.hold) / std::max(1e-9, 1.0 - options.hold), 0.0, 1.0);
  const double share = 0.5 * (1.0 + std::cos(std::numbers::pi * falling));
  return warm * options.learning_rate * (options.final_share + (1.0 - options.final_share) * share);
}

class Adam {
 public:
  Adam(const at::Tensor& parameters, double first_decay, double second_decay)
      : mean_(at::zeros_like(parameters)),
        square_(at::zeros_like(parameters)),
        first_decay_(first_decay),
        second_decay_(second_decay) {}

  void step(at::Tensor& parameters, const at::Tensor& gradient, double learning_rate) {
    ++steps_;
    mean_.mul_(first_decay_).add_(gradient, 1.0 - first_decay_);
    square_.mul_(second_decay_).addcmul_(gradient, gradient, 1.0 - second_decay_);
    const double correction = std::sqrt(1.0 - std::pow(second_decay_, steps_));
    at::sqrt_out(scratch_, square_).add_(1e-8 * correction);
    parameters.addcdiv_(mean_, scratch_,
                        -learning_rate * correction / (1.0 - std::pow(first_decay_, steps_)));
  }

 private:
  at::Tensor mean_, square_, scratch_ = at::empty_like(mean_);
  double first_decay_, second_decay_;
  int steps_ = 0;
};

std::string message(const LoopOptions& options, int done, double loss, double left) {
  char text[160];
  std::snprintf(text, sizeof text, "%s: iteration %d of %d, loss %.5g, %.0f s left", options.stage.c_str(),
                done, options.iterations, loss, left);
  return text;
}

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
  constexpr int snapshot_every = 10;
  const auto begin = Clock::now();
  const int history_every = std::max(1, options.iterations / 200);
  LoopResult result;
  Random random(options.seed, 0x5eed);
  Adam adam(field.parameters(), options.first_decay, options.second_decay);
  GoodState good{field.parameters().clone(), 0};
  double smooth = 0.0, reported = -1.0;
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    progress.check();
    const double elapsed = seconds_since(begin);
    double done = static_cast<double>(iteration) / options.iterations;
    if (options.time_budget > 0.0) {
      if (elapsed >= options.time_budget) {
        result.out_of_time = true;
        break;
      }
      done = std::max(done, elapsed / options.time_budget);
    }
    field.gradient().zero_();
    const double loss = objective.accumulate(field, random);
    if (!std::isfinite(loss)) diverge(field, good, options, iteration);
    smooth = iteration == 0 ? loss : 0.9 * smooth + 0.1 * loss;
    if (iteration % history_every == 0) result.history.emplace_back(iteration, loss);
    if (iteration % snapshot_every == 0) {
      good.parameters.copy_(field.parameters());
      good.iteration = iteration;
    }
    adam.step(field.parameters(), field.gradient(), rate(options, done, iteration));
    result.iterations = iteration + 1;
    if (elapsed - reported > 0.1) {
      reported = elapsed;
      const double left = elapsed * (1.0 - done) / std::max(done, 1e-3);
      progress.report(done, message(options, iteration + 1, smooth, done > 0.0 ? left : 0.0));
    }
    if (observer) observer(iteration + 1);
  }
  if (!at::isfinite(field.parameters()).all().item<bool>()) diverge(field, good, options, result.iterations);
  result.seconds = seconds_since(begin);
  progress.report(1.0);
  return result;
}

}  // namespace arapfields
