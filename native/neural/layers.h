// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"
#include "neural/mlp.h"

namespace arapfields {

/// A network's numbers as plain matrices, for exchange with Python and files: weights[l] (fan_out, fan_in),
/// biases[l] (fan_out); the last pair is the output layer.
struct Layers {
  std::vector<RowMatrix<double>> weights;
  std::vector<Vector> biases;
};

/// The shape that the matrices describe. Throws InvalidInput naming the layer where they do not fit together,
/// do not start with 6·octaves inputs, or hold NaN or infinite numbers.
MlpShape shape_of(const Layers& layers, int octaves, double frequency, double sharpness);
/// A network with these numbers.
Mlp make_mlp(const Layers& layers, const MlpShape& shape, bool double_precision = false,
             const std::string& device = "cpu");
Layers layers_of(const Mlp& mlp);

/// Jets (columns, n, outputs) at points (n,3), row by row, and for given cotangents (the same size, or none)
/// the flat parameter gradient: the network's two sweeps in double precision on plain arrays.
struct JetSweeps {
  Vector jets, gradient;
};
JetSweeps sweep_jets(Mlp& mlp, PointsIn points, JetOrder order, const Vector& cotangents);

/// The network after one step of orthogonalised momentum along a flat gradient, momentum at rest before.
Layers step_muon(Mlp& mlp, const Vector& gradient, double learning_rate);

/// A network with random numbers, points and cotangents, whose two sweeps can be run and timed.
class JetTrial {
 public:
  JetTrial(const MlpShape& shape, Index points, JetOrder order, std::uint64_t seed);
  ~JetTrial();
  void run();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
