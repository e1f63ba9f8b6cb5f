// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "neural/layers.h"

namespace arapfields::python {
namespace {

Layers as_layers(const py::sequence& weights, const py::sequence& biases) {
  Layers layers;
  for (const auto& weight : weights)
    layers.weights.emplace_back(as_matrix(weight, "weights[" + std::to_string(layers.weights.size()) + "]"));
  for (const auto& bias : biases)
    layers.biases.emplace_back(as_vector(bias, "biases[" + std::to_string(layers.biases.size()) + "]"));
  return layers;
}

py::array_t<double> as_array(const Vector& flat, const std::vector<Index>& shape) {
  py::array_t<double> array(shape);
  Eigen::Map<Vector>(array.mutable_data(), flat.size()) = flat;
  return array;
}

void bind_testing(py::module_& module) {
  py::module_ testing =
      module.def_submodule("testing", "What the tests call directly; not part of the interface.");
  testing.def(
      "mlp_jets",
      [](const py::sequence& weights, const py::sequence& biases, int octaves, double frequency,
         double sharpness, const py::object& points, int order, const py::object& cotangents,
         bool double_precision) {
        const Layers layers = as_layers(weights, biases);
        const MlpShape shape = shape_of(layers, octaves, frequency, sharpness);
        Mlp mlp = make_mlp(layers, shape, double_precision);
        const Points where = as_points(points, "points");
        const int count = order == 0 ? 1 : order == 1 ? 4 : 10;
        const Vector given = cotangents.is_none() ? Vector() : as_vector(cotangents, "cotangents");
        const JetSweeps sweeps = sweep_jets(mlp, where, static_cast<JetOrder>(count), given);
        return py::make_tuple(as_array(sweeps.jets, {count, where.rows(), shape.outputs}), sweeps.gradient);
      },
      "weights"_a, "biases"_a, "octaves"_a, "frequency"_a, "sharpness"_a, "points"_a, "order"_a,
      "cotangents"_a = py::none(), "double_precision"_a = true,
      "Jets (columns, n, outputs) of order 0, 1 or 2 and, for flat cotangents of them, the flat parameter "
      "gradient.");
}

}  // namespace

void bind_neural(py::module_& module) { bind_testing(module); }

}  // namespace arapfields::python
