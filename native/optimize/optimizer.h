// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/types.h"
#include "options/training.h"

namespace arapfields {

/// A weight matrix within a vector of parameters, row by row, that an optimizer may treat as a matrix.
struct MatrixPlace {
  Index begin = 0, rows = 0, columns = 0;

  Index end() const { return begin + rows * columns; }
};

class Tensor;

struct AdamOptions {
  double beta1 = 0.9;   ///< β1, of the gradient's running mean
  double beta2 = 0.99;  ///< β2, of the running mean of its squares
  double epsilon = 1e-8;
};

/// Adam (Kingma and Ba 2015, algorithm 1, with both bias corrections) on a flat contiguous vector of
/// parameters, in one pass over memory; float or double, on any device.
class AdamStep {
 public:
  /// Keeps nothing of `parameters` but its size, dtype and device.
  explicit AdamStep(const Tensor& parameters, const AdamOptions& options = {});
  ~AdamStep();
  AdamStep(AdamStep&&) noexcept;
  AdamStep& operator=(AdamStep&&) noexcept;

  /// parameters −= learning_rate · (mean / √square), both corrected.
  void step(Tensor& parameters, const Tensor& gradient, double learning_rate);
  /// The same for entries [begin, end) alone; the caller counts steps by next_step().
  void step_range(Tensor& parameters, const Tensor& gradient, double learning_rate, Index begin, Index end);
  void next_step();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

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

/// Steps along the gradient: optimize/optimizer.h for the matrices, or optimize/optimizer.h. Parameters
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
