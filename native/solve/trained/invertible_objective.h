// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "fields/neural_field.h"
#include "mesh/surface_samples.h"
#include "solve/trained/objective.h"

namespace arapfields {

class Tensor;

/// An inner objective plus weight · mean ‖g(f(x)) − x‖² over samples and uniform points of the cube, with a
/// network g ≈ f⁻¹ that is trained alongside f. Where f folds no inverse exists, so the term penalises folds.
class InvertibleObjective final : public Objective {
 public:
  InvertibleObjective(Objective& inner, const SurfaceSamples& samples, Index batch, double weight,
                      const MlpShape& shape, const LoopOptions& options, const std::string& device);
  Tensor accumulate(TrainableField& field, Random& random) override;
  std::vector<LossTerm> terms() const override;

 private:
  Objective& inner_;
  const SurfaceSamples& samples_;
  Index batch_;
  double weight_;
  LoopOptions options_;
  int done_ = 0;
  NeuralField inverse_;
  Optimizer optimizer_;
  std::shared_ptr<Tensor> cycle_;  // the last estimate of the weighted term
};

}  // namespace arapfields
