// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "neural/layers.h"
#include "neural/neural_sdf.h"

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

Points finite_points(const py::object& points) {
  Points p = as_points(points, "points");
  require(p.allFinite(), "points", "some coordinates are NaN or infinite", "all must be finite");
  return p;
}

/// Runs `call`, and names the file in what it finds wrong with the file's content.
template <class Call>
auto naming_file(const py::object& path, Call&& call) {
  const std::string name = py::cast<std::string>(py::str(path));
  try {
    return call();
  } catch (const InvalidInput& error) {
    throw InvalidInput(name, "cannot be loaded", error.what());
  } catch (const py::error_already_set& error) {
    if (!error.matches(PyExc_KeyError) && !error.matches(PyExc_TypeError)) throw;
    throw InvalidInput(name, "cannot be loaded", "an entry is missing or of the wrong type");
  } catch (const py::cast_error&) {
    throw InvalidInput(name, "cannot be loaded", "an entry is of the wrong type");
  }
}

void save(const py::object& self, const py::object& path) {
  const NeuralSdf& sdf = py::cast<const NeuralSdf&>(self);
  const MlpShape& shape = sdf.shape();
  const Layers layers = sdf.layers();
  py::list weights, biases;  // single precision holds all there is
  for (const RowMatrix<double>& weight : layers.weights)
    weights.append(RowMatrix<float>(weight.cast<float>()));
  for (const Vector& bias : layers.biases) biases.append(VectorF(bias.cast<float>()));
  const py::dict network("octaves"_a = shape.octaves, "frequency"_a = shape.frequency,
                         "sharpness"_a = shape.softplus_sharpness, "weights"_a = weights,
                         "biases"_a = biases);
  const py::dict frame("center"_a = sdf.frame().center, "scale"_a = sdf.frame().scale);
  py::module_::import("arapfields._files")
      .attr("save_state")(
          path, "sdf", py::dict("network"_a = network, "frame"_a = frame, "report"_a = self.attr("report")));
}

py::object load(const py::object& path) {
  const py::dict state = py::module_::import("arapfields._files").attr("load_state")(path, "sdf");
  return naming_file(path, [&] {
    const py::dict network = state["network"], place = state["frame"];
    const Frame frame{as_vec3(place["center"], "center"), py::cast<double>(place["scale"])};
    require(std::isfinite(frame.scale) && frame.scale > 0, "scale", "got " + std::to_string(frame.scale),
            "must be positive");
    py::object sdf = py::cast(NeuralSdf::from_layers(
        as_layers(network["weights"], network["biases"]), py::cast<int>(network["octaves"]),
        py::cast<double>(network["frequency"]), py::cast<double>(network["sharpness"]), frame));
    sdf.attr("_report") = py::dict(state["report"]);
    return sdf;
  });
}

void bind_sdf(py::module_& module) {
  py::class_<ImplicitFunction, std::shared_ptr<ImplicitFunction>>(
      module, "ImplicitFunction",
      "A function on the unit cube whose zero set is a surface; negative inside.");
  py::class_<NeuralSdf, ImplicitFunction, std::shared_ptr<NeuralSdf>>(
      module, "NeuralSdf", py::dynamic_attr(),
      "A signed distance function by a network: negative inside, in the mesh's coordinates and unit.\n\n"
      "Positional encoding, then layers of softplus units.\n"
      "Made by fit_sdf, from_layers or load. Outside the frame's cube, where the network has learnt "
      "nothing:\n"
      "its value at the cube's nearest point plus the distance to that point.")
      .def_static(
          "from_layers",
          [](const py::sequence& weights, const py::sequence& biases, int octaves, double frequency,
             double sharpness) {
            return NeuralSdf::from_layers(as_layers(weights, biases), octaves, frequency, sharpness);
          },
          "weights"_a, "biases"_a, "octaves"_a = NetworkOptions().octaves,
          "frequency"_a = NetworkOptions().frequency, "sharpness"_a = NetworkOptions().softplus_sharpness,
          "A published network, in cube coordinates (its frame is the identity).\n\n"
          "weights[l] (out, in) and biases[l] (out,) of each layer, the last with one output; the first "
          "takes\n"
          "6*octaves numbers: for x, y, z in turn and k < octaves, cos(2^k*frequency*c), "
          "sin(2^k*frequency*c).\n"
          "sharpness is softplus's beta. InvalidInput where shapes do not fit or numbers are not finite.")
      .def(
          "__call__",
          [](const NeuralSdf& sdf, const py::object& points) {
            const Points p = finite_points(points);
            return run_long(nullptr, [&](const Progress&) { return sdf.distances(p); });
          },
          "points"_a, "Distances (p,) at points (p,3), negative inside; mesh coordinates and unit.")
      .def(
          "gradient",
          [](const NeuralSdf& sdf, const py::object& points) {
            const Points p = finite_points(points);
            return run_long(nullptr, [&](const Progress&) { return sdf.gradients(p); });
          },
          "points"_a, "Derivatives (p,3) of the distance by the point: about unit length, pointing outwards.")
      .def_property_readonly(
          "layers",
          [](const NeuralSdf& sdf) {
            const MlpShape& shape = sdf.shape();
            Layers layers = sdf.layers();
            return py::make_tuple(layers.weights, layers.biases, shape.octaves, shape.frequency,
                                  shape.softplus_sharpness);
          },
          "The network's numbers, as from_layers takes them: weights, biases, octaves, frequency, sharpness.")
      .def_property_readonly("frame", &NeuralSdf::frame, "Mesh coordinates and the unit cube.")
      .def_property_readonly(
          "report", [](const py::object& self) { return py::getattr(self, "_report", py::dict()); },
          "What the fit measured, as a dict (see fit_sdf); empty for none.")
      .def("save", &save, "path"_a,
           "Writes network, frame and report as one file, whole or not at all; OSError where that fails.")
      .def_static(
          "load", &load, "path"_a,
          "What save() wrote. OSError for a file that cannot be read, InvalidInput naming the file for\n"
          "one that is damaged, foreign, of another kind or version, or holds unusable numbers.")
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
      .def("run", &JetTrial::run, py::call_guard<py::gil_scoped_release>());
  testing.def(
      "mlp_jets",
      [](const py::sequence& weights, const py::sequence& biases, int octaves, double frequency,
         double sharpness, const py::object& points, int order, const py::object& cotangents,
         bool double_precision) {
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
      [](const py::sequence& weights, const py::sequence& biases, int octaves, const py::object& gradient,
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
  bind_sdf(module);
  bind_testing(module);
}

}  // namespace arapfields::python
