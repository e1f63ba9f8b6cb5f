// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "optimize/adam_step.h"
#include "optimize/matrix_place.h"

namespace arapfields {

class Tensor;

struct MuonOptions {
  double momentum = 0.95;
  int iterations = 5;       ///< of the Newton–Schulz polynomial
  double adam_share = 0.1;  ///< Adam's learning rate (biases, output layer) over that of the matrices
  AdamOptions adam;
};

/// Orthogonalised momentum (Muon; Jordan et al. 2024) for the weights of hidden layers, Adam for biases and
/// output layers. The momentum matrix G = U S Vᵀ is replaced by about U Vᵀ through five iterations
/// of an odd polynomial, so that all directions of a layer learn at the same pace.
class Muon {
 public:
  /// `matrices` are in ascending order of their places in the parameters; Adam moves all other parameters.
  Muon(const Tensor& parameters, const std::vector<MatrixPlace>& matrices, const MuonOptions& options = {});
  ~Muon();
  Muon(Muon&&) noexcept;
  Muon& operator=(Muon&&) noexcept;

  /// One step along the gradient. `learning_rate` is the change of a matrix's singular
  /// values, times √(rows/columns) where there are more rows.
  void step(Tensor& parameters, Tensor& gradient, double learning_rate);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
