// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"
#include "neural/mlp.h"
#include "optimize/optimizer.h"

namespace arapfields {

// A network's numbers as one vector, and whether a shape can be had: what files need.

/// Throws InvalidInput that names what is out of range.
void validate(const MlpShape& shape);
/// Weights and biases of all layers.
Index parameter_count(const MlpShape& shape);

/// The weights of the hidden layers, in the order of Mlp::parameters().
std::vector<MatrixPlace> hidden_matrices(const MlpShape& shape);

/// All numbers in the order of Mlp::parameters(), in single precision, and back. Throws InvalidInput where
/// their count does not fit the shape.
VectorF parameters_of(const Mlp& mlp);
void set_parameters(Mlp& mlp, const VectorF& parameters);

/// A network with these numbers.
Mlp make_mlp(const Layers& layers, const MlpShape& shape, bool double_precision = false,
             const std::string& device = "cpu");
Layers layers_of(const Mlp& mlp);

/// Jets (columns, n, outputs) at points (n,3), row by row, and for given cotangents (the same size, or none)
/// the flat parameter gradient: the network's two sweeps in double precision on plain arrays.
struct JetSweeps {
  Vector jets, gradient;
};
ARAPFIELDS_EXPORT_TO_TESTS JetSweeps sweep_jets(const Layers& layers, const MlpShape& shape,
                                                bool double_precision, PointsIn points, JetOrder order,
                                                const Vector& cotangents);

/// The numbers after one step of orthogonalised momentum along a flat gradient, momentum at rest before.
ARAPFIELDS_EXPORT_TO_TESTS Layers step_muon(const Layers& layers, const MlpShape& shape,
                                            const Vector& gradient, double learning_rate);

/// A network with random numbers, points and cotangents, whose two sweeps can be run and timed.
class ARAPFIELDS_EXPORT_TO_TESTS JetTrial {
 public:
  JetTrial(const MlpShape& shape, Index points, JetOrder order, std::uint64_t seed);
  ~JetTrial();
  void run();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
