// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/stepper.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arapfields {

Stepper::Stepper(TrainableField& field, const LoopOptions& options) : field_(field), options_(options) {
  const AdamOptions adam{options.first_decay, options.second_decay, 1e-8};
  const bool orthogonal = options.optimizer == "orthogonal" && field.network() != nullptr;
  if (options.learning_rate == 0.0) options_.learning_rate = orthogonal ? 0.03 : 0.002;
  if (orthogonal)
    orthogonal_.emplace(*field.network(), OrthogonalOptions{options.momentum, 5, options.adam_share, adam});
  else
    adam_.emplace(field.parameters(), adam);
}

double Stepper::rate(double done) const {
  const double falling = std::clamp((done - options_.hold) / std::max(1e-9, 1.0 - options_.hold), 0.0, 1.0);
  const double share = 0.5 * (1.0 + std::cos(std::numbers::pi * falling));
  return options_.learning_rate * (options_.final_share + (1.0 - options_.final_share) * share);
}

void Stepper::step(double learning_rate) {
  if (orthogonal_)
    orthogonal_->step(*field_.network(), learning_rate);
  else
    adam_->step(field_.parameters(), field_.gradient(), learning_rate);
}

}  // namespace arapfields
