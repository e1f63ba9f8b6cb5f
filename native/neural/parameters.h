// SPDX-License-Identifier: GPL-3.0-or-later
// A network's numbers as one vector, and whether a shape can be had: what files need.
#pragma once

#include "core/types.h"
#include "neural/mlp.h"
#include "optimize/matrix_place.h"

namespace arapfields {

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

}  // namespace arapfields
