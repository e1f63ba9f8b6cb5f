// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/random.h"
#include "fields/neural_field.h"
#include "solve/field_objective.h"

namespace arapfields {

/// Value and parameter gradient of an objective in double precision, for comparison with differences.
struct LossProbe {
  double loss = 0.0;
  Vector gradient;
};

/// The field's parameters become `parameters`; the subsets are those of `seed`.
LossProbe probe_loss(NeuralField& field, FieldObjective& objective, const Vector& parameters,
                     std::uint64_t seed);

/// The rigidity energy and its parameter gradient in the field's usual network, for timing.
class EnergyTrial {
 public:
  /// `batch` samples an evaluation; the network starts with random weights in its last layer as well.
  EnergyTrial(const SurfaceSamples& samples, Index batch, double bending);
  double run();

 private:
  SurfaceSamples samples_;
  NeuralField field_;
  FieldObjective objective_;
  Random random_;
};

}  // namespace arapfields
