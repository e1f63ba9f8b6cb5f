// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/layers.h"

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "optimize/optimizer.h"
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

namespace {

std::string size_text(Index rows, Index cols) {
  std::string text = "(";
  return text.append(std::to_string(rows)).append(", ").append(std::to_string(cols)).append(")");
}

}  // namespace

MlpShape shape_of(const Layers& layers, int octaves, double frequency, double sharpness) {
  const std::size_t count = layers.weights.size();
  require(count >= 2 && layers.biases.size() == count, "weights",
          std::to_string(count) + " matrices and " + std::to_string(layers.biases.size()) + " biases",
          "expected as many of each, at least two");
  MlpShape shape;
  shape.layers = static_cast<int>(count) - 1;
  shape.width = static_cast<int>(layers.weights[0].rows());
  shape.outputs = static_cast<int>(layers.weights.back().rows());
  shape.octaves = octaves;
  shape.frequency = frequency;
  shape.softplus_sharpness = sharpness;
  for (std::size_t l = 0; l < count; ++l) {
    const RowMatrix<double>& weight = layers.weights[l];
    const int out = shape.fan_out(static_cast<int>(l)), in = shape.fan_in(static_cast<int>(l));
    const std::string name = "weights[" + std::to_string(l) + "]";
    require(weight.rows() == out && weight.cols() == in, name,
            "shape " + size_text(weight.rows(), weight.cols()),
            "expected " + size_text(out, in) + ": hidden layers of one width, 6·octaves inputs");
    require(weight.allFinite(), name, "NaN or infinite entries", "all must be finite");
    const Vector& bias = layers.biases[l];
    const std::string bias_name = "biases[" + std::to_string(l) + "]";
    require(bias.size() == out, bias_name, std::to_string(bias.size()) + " entries",
            "expected " + std::to_string(out));
    require(bias.allFinite(), bias_name, "NaN or infinite entries", "all must be finite");
  }
  return shape;
}

Mlp make_mlp(const Layers& layers, const MlpShape& shape, bool double_precision, const std::string& device) {
  const ThreadScope scope;
  Mlp mlp(shape, 0, true, double_precision, device);
  for (int l = 0; l <= shape.layers; ++l) {
    mlp.weight(l).assign(tensor_view(layers.weights[static_cast<std::size_t>(l)]));
    mlp.bias(l).assign(tensor_view(layers.biases[static_cast<std::size_t>(l)]));
  }
  return mlp;
}

Layers layers_of(const Mlp& mlp) {
  const ThreadScope scope;
  Layers layers;
  for (int l = 0; l <= mlp.shape().layers; ++l) {
    const Tensor weight = doubles_of(mlp.weight(l));
    layers.weights.push_back(
        Eigen::Map<const RowMatrix<double>>(weight.data<double>(), weight.size(0), weight.size(1)));
    layers.biases.push_back(vector_of(mlp.bias(l)));
  }
  return layers;
}

JetSweeps sweep_jets(const Layers& layers, const MlpShape& shape, bool double_precision, PointsIn points,
                     JetOrder order, const Vector& cotangents) {
  const ThreadScope scope;
  Mlp mlp = make_mlp(layers, shape, double_precision);
  const Tensor jets = mlp.forward(tensor_like(points, mlp.parameters()), order);
  JetSweeps result;
  result.jets = vector_of(jets);
  if (cotangents.size() == 0) return result;
  require(cotangents.size() == jets.count(), "cotangents", std::to_string(cotangents.size()) + " numbers",
          "expected " + std::to_string(jets.count()));
  mlp.gradient().set_zero();
  mlp.pull_back(tensor_like(cotangents, jets).view_like(jets));
  result.gradient = vector_of(mlp.gradient());
  return result;
}

Layers step_muon(const Layers& layers, const MlpShape& shape, const Vector& gradient, double learning_rate) {
  const ThreadScope scope;
  Mlp mlp = make_mlp(layers, shape, true);
  require(gradient.size() == mlp.gradient().count(), "gradient", std::to_string(gradient.size()) + " numbers",
          "expected " + std::to_string(mlp.gradient().count()));
  mlp.gradient().assign(tensor_view(gradient));
  Muon(mlp.parameters(), hidden_matrices(shape)).step(mlp.parameters(), mlp.gradient(), learning_rate);
  return layers_of(mlp);
}

struct JetTrial::State {
  Mlp mlp;
  JetOrder order;
  Tensor points, cotangents;
};

JetTrial::JetTrial(const MlpShape& shape, Index points, JetOrder order, std::uint64_t seed) {
  Random random(seed, 0x72a1);
  const auto draw = [&](SizeList sizes) {
    Tensor tensor = empty(sizes, NumberType::float32);
    float* values = tensor.data<float>();
    for (Index i = 0; i < tensor.count(); ++i) values[i] = static_cast<float>(random.uniform(-1.0, 1.0));
    return tensor;
  };
  state_ = std::make_unique<State>(State{Mlp(shape, seed, false), order, draw({points, 3}),
                                         draw({columns(order), points, shape.outputs})});
}
JetTrial::~JetTrial() = default;

void JetTrial::run() {
  const ThreadScope scope;
  state_->mlp.forward(state_->points, state_->order);
  state_->mlp.gradient().set_zero();
  state_->mlp.pull_back(state_->cotangents);
}

}  // namespace arapfields
