// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/optimizer.h"

#include <optional>

#include "optimize/muon.h"

namespace arapfields {

struct Optimizer::State {
  Trainable trained;
  std::optional<Muon> muon;
  std::optional<AdamStep> adam;
  double learning_rate = 0.0;
};

Optimizer::Optimizer(const Trainable& trained, const TrainingOptions& training,
                     const OptimizerOptions& options)
    : state_(std::make_unique<State>(State{trained, {}, {}, training.learning_rate})) {
  const AdamOptions adam{options.beta1, options.beta2, 1e-8};
  if (training.optimizer == OptimizerKind::muon && !trained.matrices.empty())
    state_->muon.emplace(trained.parameters, trained.matrices,
                         MuonOptions{options.momentum, 5, options.adam_share, adam});
  else
    state_->adam.emplace(trained.parameters, adam);
  if (state_->learning_rate == 0.0)
    state_->learning_rate =
        TrainingOptions::automatic_learning_rate(state_->muon ? OptimizerKind::muon : OptimizerKind::adam);
}

Optimizer::~Optimizer() = default;

void Optimizer::step(double share) {
  const Trainable& t = state_->trained;
  const double learning_rate = share * state_->learning_rate;
  if (state_->muon)
    state_->muon->step(t.parameters, t.gradient, learning_rate);
  else
    state_->adam->step(t.parameters, t.gradient, learning_rate);
}

}  // namespace arapfields
