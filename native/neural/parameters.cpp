// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/parameters.h"

#include "core/errors.h"
#include "core/parallel.h"
#include "tensors/views.h"

namespace arapfields {

void validate(const MlpShape& shape) {
  require_range("outputs", shape.outputs, 1, 1024);
  shape.validate();
}

Index parameter_count(const MlpShape& shape) {
  Index count = 0;
  for (int l = 0; l <= shape.layers; ++l)
    count += static_cast<Index>(shape.fan_out(l)) * (shape.fan_in(l) + 1);
  return count;
}

std::vector<MatrixPlace> hidden_matrices(const MlpShape& shape) {
  std::vector<MatrixPlace> places;
  Index begin = 0;
  for (int l = 0; l < shape.layers; ++l) {
    places.push_back({begin, shape.fan_out(l), shape.fan_in(l)});
    begin = places.back().end() + shape.fan_out(l);
  }
  return places;
}

VectorF parameters_of(const Mlp& mlp) {
  const ThreadScope scope;
  return floats_of(mlp.parameters());
}

void set_parameters(Mlp& mlp, const VectorF& parameters) {
  const ThreadScope scope;
  Tensor& own = mlp.parameters();
  require(parameters.size() == own.count(), "weights", std::to_string(parameters.size()) + " numbers",
          "this network has " + std::to_string(own.count()));
  own.assign(tensor_view(parameters));
}

}  // namespace arapfields
