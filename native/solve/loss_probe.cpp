// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/loss_probe.h"

#include <ATen/ATen.h>

#include "core/parallel.h"

namespace arapfields {

LossProbe probe_loss(NeuralField& field, FieldObjective& objective, const Vector& parameters,
                     std::uint64_t seed) {
  const ThreadScope scope;
  const at::Tensor given =
      at::from_blob(const_cast<double*>(parameters.data()), {parameters.size()}, at::kDouble);
  require(given.numel() == field.parameters().numel(), "parameters",
          std::to_string(given.numel()) + " numbers",
          std::to_string(field.parameters().numel()) + " are needed");
  field.parameters().copy_(given);
  field.gradient().zero_();
  Random random(seed);
  LossProbe probe;
  probe.loss = objective.accumulate(field, random).item<double>();
  const at::Tensor gradient = field.gradient().to(at::kDouble).contiguous();
  probe.gradient = Eigen::Map<const Vector>(gradient.const_data_ptr<double>(), gradient.numel());
  return probe;
}

namespace {

ObjectiveTerms rigidity_alone(Index batch, double bending) {
  ObjectiveTerms terms;
  terms.batch = batch;
  terms.surface.bending = bending;
  return terms;
}

}  // namespace

EnergyTrial::EnergyTrial(const SurfaceSamples& samples, Index batch, double bending)
    : samples_(samples),
      field_(MlpShape{}, 0),
      objective_(samples_, rigidity_alone(batch, bending)),
      random_(0) {
  field_.network()->weight(field_.shape().layers).fill_(0.01);
}

double EnergyTrial::run() {
  const ThreadScope scope;
  field_.gradient().zero_();
  return objective_.accumulate(field_, random_).item<double>();
}

}  // namespace arapfields
