// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "fields/field.h"
#include "neural/muon.h"
#include "solve/training_loop.h"

namespace arapfields {

/// The optimizer that LoopOptions name, with its default rate.
class Optimizer {
 public:
  Optimizer(TrainableField& field, const LoopOptions& options);
  /// The rate where `done` of the run has passed.
  double rate(double done) const;
  /// One step along field.gradient().
  void step(double learning_rate);

 private:
  TrainableField& field_;
  LoopOptions options_;
  std::optional<Muon> muon_;
  std::optional<AdamStep> adam_;
};

}  // namespace arapfields
