// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/adam_step.h"

#include <ATen/ATen.h>

#include <cmath>

#include "core/aten_path.h"
#include "core/parallel.h"
#include "optimize/adam_kernel.h"

namespace arapfields {
namespace {

constexpr Index grain = 16384;

template <class Scalar>
void step_on_cpu(AdamBlock<Scalar> block, const at::Tensor& parameters, const at::Tensor& gradient,
                 const at::Tensor& mean, const at::Tensor& square, Index first, Index last) {
  parallel_for(first, last, grain, [&](Index begin, Index end) {
    AdamBlock<Scalar> part = block;
    part.parameters = parameters.data_ptr<Scalar>() + begin;
    part.gradient = gradient.data_ptr<Scalar>() + begin;
    part.mean = mean.data_ptr<Scalar>() + begin;
    part.square = square.data_ptr<Scalar>() + begin;
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
  at::Tensor mean, square;
  int steps = 0;
};

AdamStep::AdamStep(const at::Tensor& parameters, const AdamOptions& options)
    : state_(std::make_unique<State>(
          State{options, at::zeros_like(parameters), at::zeros_like(parameters), 0})) {}
AdamStep::~AdamStep() = default;
AdamStep::AdamStep(AdamStep&&) noexcept = default;
AdamStep& AdamStep::operator=(AdamStep&&) noexcept = default;

void AdamStep::next_step() { ++state_->steps; }

void AdamStep::step(at::Tensor& parameters, const at::Tensor& gradient, double learning_rate) {
  next_step();
  step_range(parameters, gradient, learning_rate, 0, parameters.numel());
}

void AdamStep::step_range(at::Tensor& parameters, const at::Tensor& gradient, double learning_rate,
                          Index begin, Index end) {
  State& s = *state_;
  const double rate = learning_rate / (1.0 - std::pow(s.options.beta1, s.steps));
  const double scale = 1.0 / std::sqrt(1.0 - std::pow(s.options.beta2, s.steps));
  if (on_aten_path(parameters)) {
    at::Tensor mean = s.mean.slice(0, begin, end), square = s.square.slice(0, begin, end);
    const at::Tensor g = gradient.slice(0, begin, end);
    mean.mul_(s.options.beta1).add_(g, 1.0 - s.options.beta1);
    square.mul_(s.options.beta2).addcmul_(g, g, 1.0 - s.options.beta2);
    parameters.slice(0, begin, end)
        .addcdiv_(mean, at::sqrt(square).mul_(scale).add_(s.options.epsilon), -rate);
  } else if (parameters.scalar_type() == at::kDouble) {
    step_on_cpu(block_with<double>(s.options, rate, scale), parameters, gradient, s.mean, s.square, begin,
                end);
  } else {
    step_on_cpu(block_with<float>(s.options, rate, scale), parameters, gradient, s.mean, s.square, begin,
                end);
  }
}

}  // namespace arapfields
