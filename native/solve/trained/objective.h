// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "core/random.h"
#include "fields/field.h"
#include "optimize/training_loop.h"

namespace arapfields {

class Tensor;

/// A loss of a trainable field, estimated anew at each iteration on a random subset.
class Objective {
 public:
  virtual ~Objective() = default;
  /// Adds the gradient of the estimate to field.gradient(); returns the estimate, a scalar on the device
  /// where it was computed.
  virtual Tensor accumulate(TrainableField& field, Random& random) = 0;
  /// The weighted terms of the last estimate, whose sum it is.
  virtual std::vector<LossTerm> terms() const { return {}; }
};

/// Called with the number of finished iterations after each of them.
using LoopObserver = std::function<void(int)>;

/// The parameters of a field, as an optimizer takes them.
inline Trainable trainable(TrainableField& field) {
  return {field.parameters(), field.gradient(), field.matrices()};
}

/// Minimises by run_training(), with random numbers of the options' seed. What it returns is finite at the
/// field's rest points.
LoopResult minimise(TrainableField& field, Objective& objective, const LoopOptions& options,
                    const Progress& progress, const LoopObserver& observer = {});

}  // namespace arapfields
