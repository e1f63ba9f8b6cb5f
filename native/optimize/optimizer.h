// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "optimize/matrix_place.h"
#include "options/training.h"

namespace arapfields {

class Tensor;

/// Fixed parameters of the optimizers. Momentum and betas are low, for the few hundred steps of a solve.
struct OptimizerOptions {
  double momentum = 0.8;    ///< of muon
  double adam_share = 0.3;  ///< of muon: the rate of biases and the output layer over the matrices'
  double beta1 = 0.8, beta2 = 0.9;
};

/// Trainable parameters and their gradient, each one contiguous vector, and the places of hidden layers'
/// matrices in them, ascending.
struct Trainable {
  Tensor& parameters;
  Tensor& gradient;
  std::vector<MatrixPlace> matrices = {};
};

/// Steps along the gradient: optimize/muon.h for the matrices, or optimize/adam_step.h. Parameters
/// without matrices are moved by Adam, whatever the options say; a learning rate of 0 is the kind's own.
class Optimizer {
 public:
  Optimizer(const Trainable& trained, const TrainingOptions& training, const OptimizerOptions& options);
  ~Optimizer();
  /// One step with `share` times the learning rate.
  void step(double share);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
