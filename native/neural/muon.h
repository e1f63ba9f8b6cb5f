// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "neural/adam_step.h"
#include "neural/mlp.h"

namespace arapfields {

struct MuonOptions {
  double momentum = 0.95;
  int iterations = 5;       ///< of the Newton–Schulz polynomial
  double adam_share = 0.1;  ///< Adam's learning rate (biases, output layer) over that of the matrices
  AdamOptions adam;
};

/// Orthogonalised momentum (Muon; Jordan et al. 2024) for the weights of an Mlp's hidden layers, Adam for its
/// biases and output layer. The momentum matrix G = U S Vᵀ is replaced by about U Vᵀ through five iterations
/// of an odd polynomial, so that all directions of a layer learn at the same pace.
class Muon {
 public:
  explicit Muon(const Mlp& mlp, const MuonOptions& options = {});
  ~Muon();
  Muon(Muon&&) noexcept;
  Muon& operator=(Muon&&) noexcept;

  /// One step on mlp.parameters() along mlp.gradient(). `learning_rate` is the change of a matrix's singular
  /// values, times √(rows/columns) where there are more rows.
  void step(Mlp& mlp, double learning_rate);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
