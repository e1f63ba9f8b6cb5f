// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/loss_probe.h"

#include <ATen/ATen.h>

namespace arapfields {

LossProbe probe_loss(NeuralField& field, FieldObjective& objective, const Vector& parameters,
                     std::uint64_t seed) {
  const at::Tensor given =
      at::from_blob(const_cast<double*>(parameters.data()), {parameters.size()}, at::kDouble);
  require(given.numel() == field.parameters().numel(), "parameters",
          std::to_string(given.numel()) + " numbers",
          std::to_string(field.parameters().numel()) + " are needed");
  field.parameters().copy_(given);
  field.gradient().zero_();
  Random random(seed);
  LossProbe probe;
  probe.loss = objective.accumulate(field, random);
  const at::Tensor gradient = field.gradient().to(at::kDouble).contiguous();
  probe.gradient = Eigen::Map<const Vector>(gradient.const_data_ptr<double>(), gradient.numel());
  return probe;
}

}  // namespace arapfields
