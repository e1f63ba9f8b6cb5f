// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fields/neural_field.h"
#include "options/inverse.h"
#include "solve/optimizer.h"
#include "solve/report.h"

namespace arapfields {

/// A network g ≈ f⁻¹, trained on the cycle ‖f(g(y)) − y‖² at deformed samples and at uniform points of their
/// box (enlarged by a tenth), and at the samples x on ‖g(f(x)) − x‖² too, which decides where f has several
/// preimages. Its report's energy is that mean square cycle error; the frame is f's.
Solution train_inverse(const DeformationField& field, const SurfaceSamples& samples,
                       const InverseTrainingOptions& options, const Progress& progress = {});

/// Another objective, and weight × mean ‖g(f(x)) − x‖² with an inverse g that learns beside f, over samples
/// and uniform points of the cube: where f folds no g exists, so folds cost.
class InvertibleObjective final : public Objective {
 public:
  InvertibleObjective(Objective& inner, const SurfaceSamples& samples, Index batch, double weight,
                      const MlpShape& shape, const LoopOptions& options, const std::string& device);
  at::Tensor accumulate(TrainableField& field, Random& random) override;

 private:
  Objective& inner_;
  const SurfaceSamples& samples_;
  Index batch_;
  double weight_;
  int iterations_, done_ = 0;
  NeuralField inverse_;
  Optimizer optimizer_;
};

}  // namespace arapfields
