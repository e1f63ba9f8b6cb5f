// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/adam_step.h"

#include <cmath>

#include "core/parallel.h"
#include "optimize/adam_kernel.h"
#include "tensors/device_path.h"
#include "tensors/operations.h"

namespace arapfields {
namespace {

constexpr Index grain = 16384;

template <class Scalar>
void step_on_cpu(AdamBlock<Scalar> block, const Tensor& parameters, const Tensor& gradient,
                 const Tensor& mean, const Tensor& square, Index first, Index last) {
  parallel_for(first, last, grain, [&](Index begin, Index end) {
    AdamBlock<Scalar> part = block;
    part.parameters = parameters.data<Scalar>() + begin;
    part.gradient = gradient.data<Scalar>() + begin;
    part.mean = mean.data<Scalar>() + begin;
    part.square = square.data<Scalar>() + begin;
    part.count = end - begin;
    ARAPFIELDS_DISPATCH(adam(part));
  });
}

template <class Scalar>
AdamBlock<Scalar> block_with(const AdamOptions& options, double rate, double scale) {
  AdamBlock<Scalar> block;
  block.beta1 = static_cast<Scalar>(options.beta1);
  block.beta2 = static_cast<Scalar>(options.beta2);
  block.rate = static_cast<Scalar>(rate);
  block.scale = static_cast<Scalar>(scale);
  block.epsilon = static_cast<Scalar>(options.epsilon);
  return block;
}

}  // namespace

struct AdamStep::State {
  AdamOptions options;
  Tensor mean, square;
  int steps = 0;
};

AdamStep::AdamStep(const Tensor& parameters, const AdamOptions& options)
    : state_(std::make_unique<State>(State{options, zeros_like(parameters), zeros_like(parameters), 0})) {}
AdamStep::~AdamStep() = default;
AdamStep::AdamStep(AdamStep&&) noexcept = default;
AdamStep& AdamStep::operator=(AdamStep&&) noexcept = default;

void AdamStep::next_step() { ++state_->steps; }

void AdamStep::step(Tensor& parameters, const Tensor& gradient, double learning_rate) {
  next_step();
  step_range(parameters, gradient, learning_rate, 0, parameters.count());
}

void AdamStep::step_range(Tensor& parameters, const Tensor& gradient, double learning_rate, Index begin,
                          Index end) {
  State& s = *state_;
  const double rate = learning_rate / (1.0 - std::pow(s.options.beta1, s.steps));
  const double scale = 1.0 / std::sqrt(1.0 - std::pow(s.options.beta2, s.steps));
  if (on_device_path(parameters)) {
    Tensor mean = s.mean.slice(0, begin, end), square = s.square.slice(0, begin, end);
    const Tensor g = gradient.slice(0, begin, end);
    (mean *= s.options.beta1).add(g, 1.0 - s.options.beta1);
    (square *= s.options.beta2).add_product(g, g, 1.0 - s.options.beta2);
    parameters.slice(0, begin, end).add_quotient(mean, sqrt(square) * scale + s.options.epsilon, -rate);
  } else if (parameters.is_double()) {
    step_on_cpu(block_with<double>(s.options, rate, scale), parameters, gradient, s.mean, s.square, begin,
                end);
  } else {
    step_on_cpu(block_with<float>(s.options, rate, scale), parameters, gradient, s.mean, s.square, begin,
                end);
  }
}

}  // namespace arapfields
