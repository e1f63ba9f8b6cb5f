// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/files.h"
#include "bindings/reports.h"
#include "io/files.h"
#include "neural/fit.h"
#include "neural/layers.h"
#include "neural/neural_sdf.h"

namespace arapfields::python {
namespace {

/// More than any network that the options allow has.
constexpr std::size_t most_layers = 1024;

std::vector<py::object> as_list(const py::object& arrays, const std::string& argument) {
  std::vector<py::object> items;
  for_each_item(arrays, argument, "a list of arrays, one a layer, is needed", sizeof(py::object),
                [&](const py::object& item, const std::string&) {
                  require(items.size() < most_layers, argument, "more than " + std::to_string(most_layers),
                          "one a layer is needed");
                  items.push_back(item);
                });
  return items;
}

Layers as_layers(const py::object& weights, const py::object& biases) {
  Layers layers;
  for (const py::object& weight : as_list(weights, "weights"))
    layers.weights.emplace_back(as_matrix(weight, "weights[" + std::to_string(layers.weights.size()) + "]"));
  for (const py::object& bias : as_list(biases, "biases"))
    layers.biases.emplace_back(as_vector(bias, "biases[" + std::to_string(layers.biases.size()) + "]"));
  return layers;
}

py::array_t<double> as_array(const Vector& flat, const std::vector<Index>& shape) {
  py::array_t<double> array(shape);
  Eigen::Map<Vector>(array.mutable_data(), flat.size()) = flat;
  return array;
}

void save_network(const py::object& self, const PathArgument& path) {
  const auto& sdf = py::cast<const NeuralSdf&>(self);
  const std::string place = as_path(path), measured = report_text(report_or_none(self));
  const py::gil_scoped_release release;
  save_sdf(place, sdf, measured);
}

NeuralSdfResult loaded_network(const PathArgument& path) {
  const std::string place = as_path(path);
  std::string measured;
  py::object sdf = py::cast(run_long([&] { return load_sdf(place, &measured); }));
  attach_report(sdf, report_from(measured, place));
  return sdf;
}

void bind_sdf(py::module_& module) {
  py::class_<NeuralSdf, ImplicitFunction, std::shared_ptr<NeuralSdf>>(module, "NeuralSdf", py::dynamic_attr(),
                                                                      R"(
A signed distance function represented by a network, negative inside; mesh coordinates and unit.

Positional encoding, then layers of softplus units. Made by fit_sdf, from_layers or load. Outside the frame's
cube, where the network is not trained, it is the value at the cube's nearest point plus the distance to it.)")
      .def_static(
          "from_layers",
          [](const ArraysArgument& weights, const ArraysArgument& biases, int octaves, double frequency,
             double sharpness) {
            return NeuralSdf::from_layers(as_layers(weights, biases), octaves, frequency, sharpness);
          },
          "weights"_a, "biases"_a, "octaves"_a = NetworkOptions().octaves,
          "frequency"_a = NetworkOptions().frequency, "sharpness"_a = NetworkOptions().softplus_sharpness,
          R"(
A published network, in cube coordinates (its frame is the identity).

weights[l] (out, in) and biases[l] (out,) of each layer, the last with one output. The first layer takes
6*octaves numbers: for x, y, z in turn and k < octaves, cos(2^k*frequency*c), sin(2^k*frequency*c). sharpness
is softplus's beta. InvalidInput where shapes do not fit or numbers are not finite.)")
      .def(
          "__call__",
          [](const NeuralSdf& sdf, const ArrayArgument& points) {
            const Points p = as_finite_points(points, "points");
            return run_long([&] { return sdf.distances(p); });
          },
          "points"_a, "Distances (p,) at points (p,3), negative inside; mesh coordinates and unit.")
      .def(
          "gradient",
          [](const NeuralSdf& sdf, const ArrayArgument& points) {
            const Points p = as_finite_points(points, "points");
            return run_long([&] { return sdf.gradients(p); });
          },
          "points"_a, "Gradients (p, 3) of the distance: about unit length, pointing outwards.")
      .def_property_readonly(
          "layers",
          [](const NeuralSdf& sdf) {
            const MlpShape& shape = sdf.shape();
            Layers layers = sdf.layers();
            return std::make_tuple(layers.weights, layers.biases, shape.octaves, shape.frequency,
                                   shape.softplus_sharpness);
          },
          "The network's numbers, as from_layers takes them: weights, biases, octaves, frequency, sharpness.")
      .def_property_readonly("frame", method(&NeuralSdf::frame), "The Frame of the unit cube.")
      .def_property_readonly(
          "report", [](const py::object& self) { return FitReportResult(report_of(self)); },
          "The FitReport; AttributeError for a network that fit_sdf did not make.")
      .def("save", &save_network, "path"_a,
           "Writes network, frame and report as one file, in whole or not at all; OSError where the system "
           "refuses.")
      .def_static("load", &loaded_network, "path"_a,
                  R"(
The network of a file that save() wrote, with its report.

OSError for a file that cannot be read. InvalidInput, naming the file, for one that is damaged, foreign, of
another kind or version, or holds unusable numbers.)")
      .def("__repr__", [](const NeuralSdf& sdf) {
        const MlpShape& s = sdf.shape();
        return py::str("NeuralSdf({} x {}, octaves={}, frequency={:g})")
            .format(s.layers, s.width, s.octaves, s.frequency);
      });
}

JetOrder order_of(int order) {
  require(order >= 0 && order <= 2, "order", std::to_string(order), "0, 1 and 2 are allowed");
  return order == 0 ? JetOrder::value : order == 1 ? JetOrder::first : JetOrder::second;
}

void bind_testing(py::module_& module) {
  py::module_ testing =
      module.def_submodule("testing", "What the tests call directly; not part of the interface.");
  py::class_<JetTrial>(testing, "JetTrial", "A random network's forward sweep and pull-back, for timing.")
      .def(py::init([](Index points, int order, int width, int layers) {
             MlpShape shape;
             shape.width = width, shape.layers = layers;
             return std::make_unique<JetTrial>(shape, points, order_of(order), 0);
           }),
           "points"_a, "order"_a, "width"_a = NetworkOptions().width, "layers"_a = NetworkOptions().layers)
      .def("run", method(&JetTrial::run));
  testing.def(
      "mlp_jets",
      [](const py::object& weights, const py::object& biases, int octaves, double frequency, double sharpness,
         const py::object& points, int order, const py::object& cotangents, bool double_precision) {
        const Layers layers = as_layers(weights, biases);
        const MlpShape shape = shape_of(layers, octaves, frequency, sharpness);
        const Points where = as_points(points, "points");
        const JetOrder jet_order = order_of(order);
        const Vector given = cotangents.is_none() ? Vector() : as_vector(cotangents, "cotangents");
        const JetSweeps sweeps = sweep_jets(layers, shape, double_precision, where, jet_order, given);
        return py::make_tuple(as_array(sweeps.jets, {columns(jet_order), where.rows(), shape.outputs}),
                              sweeps.gradient);
      },
      "weights"_a, "biases"_a, "octaves"_a, "frequency"_a, "sharpness"_a, "points"_a, "order"_a,
      "cotangents"_a = py::none(), "double_precision"_a = true,
      "Jets (columns, n, outputs) of order 0, 1 or 2 and, for flat cotangents of them, the flat parameter "
      "gradient.");
  testing.def(
      "step_muon",
      [](const py::object& weights, const py::object& biases, int octaves, const py::object& gradient,
         double learning_rate) {
        const Layers layers = as_layers(weights, biases);
        const MlpShape shape = shape_of(layers, octaves, 1.0, 30.0);
        return step_muon(layers, shape, as_vector(gradient, "gradient"), learning_rate).weights;
      },
      "weights"_a, "biases"_a, "octaves"_a, "gradient"_a, "learning_rate"_a,
      "The weights after one step of orthogonalised momentum from rest.");
}

}  // namespace

void bind_neural(py::module_& module) {
  bind_implicit(module);
  bind_sdf(module);
  bind_testing(module);
}

namespace {

py::object with_report(const FitResult& result) {
  const FitReport& r = result.report;
  py::object sdf = py::cast(result.sdf);
  attach_report(sdf, make_report("FitReport", "near_mean"_a = r.near_mean, "near_max"_a = r.near_max,
                                 "volume_mean"_a = r.volume_mean, "volume_max"_a = r.volume_max,
                                 "scale"_a = r.scale, "iterations"_a = r.iterations, "seconds"_a = r.seconds,
                                 "distance_seconds"_a = r.distance_seconds,
                                 "stopped_by"_a = name_of(r.stopped_by), "device"_a = r.device));
  return sdf;
}

NeuralSdfResult fit(const ArrayArgument& vertices, const ArrayArgument& triangles, FitOptions options,
                    const std::optional<CallbackArgument>& callback, Task* task) {
  const TriangleMesh mesh = as_mesh(vertices, triangles);
  const IterationObserver observer = as_observer(callback.value_or(py::none()));
  try {
    return with_report(run_long(task, [&](const Progress& progress) {
      return fit_sdf(mesh.vertices, mesh.triangles, options, progress, observer);
    }));
  } catch (const FitDiverged& error) {
    raise_diverged(error, with_report(error.last_good));
  }
}

}  // namespace

void bind_fit(py::module_& module) {
  module.def("fit_sdf", &fit, "vertices"_a, "triangles"_a, py::arg_v("options", FitOptions(), "FitOptions()"),
             py::kw_only(), "callback"_a = py::none(), "task"_a = py::none(),
             R"(
A NeuralSdf fitted to the signed distance of a triangle soup.

vertices (n, 3), triangles (m, 3), counter-clockwise seen from outside; open and self-intersecting meshes are
allowed, as in signed_distance. The frame is that of sample_mesh, enlarged where the mesh would leave its
cube. Exact distances near the surface and in the cube are regressed with the mean absolute error. The hidden
layers are trained by orthogonalised momentum (Muon; Jordan et al. 2024), the rest by Adam, at a rate that
falls linearly to zero.

`callback` is called with each Iteration, whose one term is error, and ends the fit by raising StopIteration.
report is a FitReport. InvalidInput for a broken mesh or option; Cancelled; Diverged, whose `last_good` is the
last fit with finite numbers.)");
}

}  // namespace arapfields::python
