// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

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

}  // namespace arapfields
