// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/trained/objective.h"

#include <algorithm>
#include <cstdio>

#include "core/jets.h"
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
  /// At the field's rest points, with all derivatives that a report measures.
  bool is_finite() override {
    constexpr Index rows = 1024;
    const Points& rest = field_.rest_points();
    for (Index begin = 0; begin < rest.rows(); begin += rows) {
      const Points part = rest.middleRows(begin, std::min(rows, rest.rows() - begin));
      JetBlock<double> jets(part.rows(), JetOrder::second);
      field_.evaluate(part, jets.view());
      if (!Eigen::Map<const Vector>(jets.view().data, jets.view().size()).allFinite()) return false;
    }
    return true;
  }
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
