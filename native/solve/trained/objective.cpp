// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/trained/objective.h"

#include <cstdio>

#include "tensors/operations.h"

namespace arapfields {
namespace {

class FieldLoop final : public LoopBody {
 public:
  FieldLoop(TrainableField& field, Objective& objective, const LoopOptions& options,
            const LoopObserver& observer)
      : field_(field),
        objective_(objective),
        options_(options),
        observer_(observer),
        random_(static_cast<std::uint64_t>(options.training.seed), 0x5eed) {}

  Tensor accumulate(int) override { return objective_.accumulate(field_, random_); }
  std::vector<LossTerm> terms() const override { return objective_.terms(); }
  void iterated(int count) override {
    if (observer_) observer_(count);
  }
  std::string message(int count, double loss, double seconds_left) const override {
    char text[160];
    std::snprintf(text, sizeof text, "iteration %d of %d, loss %.5g, %.0f s left", count,
                  options_.training.iterations, loss, seconds_left);
    return text;
  }

 private:
  TrainableField& field_;
  Objective& objective_;
  const LoopOptions& options_;
  const LoopObserver& observer_;
  Random random_;
};

}  // namespace

LoopResult minimise(TrainableField& field, Objective& objective, const LoopOptions& options,
                    const Progress& progress, const LoopObserver& observer) {
  FieldLoop body(field, objective, options, observer);
  return run_training(trainable(field), body, options, progress);
}

}  // namespace arapfields
