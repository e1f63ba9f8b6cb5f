// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/optimizer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arapfields {

Optimizer::Optimizer(TrainableField& field, const LoopOptions& options) : field_(field), options_(options) {
  const AdamOptions adam{options.beta1, options.beta2, 1e-8};
  const bool muon = options.training.optimizer == OptimizerKind::muon && field.network() != nullptr;
  double& peak = options_.training.learning_rate;
  if (peak == 0.0)
    peak = TrainingOptions::automatic_learning_rate(muon ? OptimizerKind::muon : OptimizerKind::adam);
  if (muon)
    muon_.emplace(*field.network(), MuonOptions{options.momentum, 5, options.adam_share, adam});
  else
    adam_.emplace(field.parameters(), adam);
}

double Optimizer::rate(double done) const {
  const double falling = std::clamp(
      (done - options_.lr_hold_fraction) / std::max(1e-9, 1.0 - options_.lr_hold_fraction), 0.0, 1.0);
  const double share = 0.5 * (1.0 + std::cos(std::numbers::pi * falling));
  return options_.training.learning_rate * (options_.final_share + (1.0 - options_.final_share) * share);
}

void Optimizer::step(double learning_rate) {
  if (muon_)
    muon_->step(*field_.network(), learning_rate);
  else
    adam_->step(field_.parameters(), field_.gradient(), learning_rate);
}

}  // namespace arapfields
