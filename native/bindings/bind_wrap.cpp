// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/python_function.h"
#include "bindings/reports.h"
#include "wrap/wrap.h"

namespace arapfields::python {
namespace {

std::vector<Landmark> as_landmarks(const LandmarksArgument& argument) {
  const std::string allowed = "pairs (rest, on_target) of places (3,) are needed";
  std::vector<Landmark> landmarks;
  for_each_item(
      argument, "landmarks", allowed, sizeof(Landmark), [&](const py::object& pair, const std::string& name) {
        Landmark landmark;
        int k = 0;
        for_each_item(pair, name, allowed, 0.0, [&](const py::object& place, const std::string& which) {
          require(k < 2, name, "more than two of them", allowed);
          (k++ == 0 ? landmark.rest : landmark.target) = as_vec3(place, which);
        });
        require(k == 2, name, std::to_string(k) + " of them", allowed);
        landmarks.push_back(landmark);
      });
  return landmarks;
}

WrapResult wrap_samples(const SurfaceSamples& samples, const FunctionArgument& target,
                        const LandmarksArgument& landmarks, WrapOptions options, Task* task) {
  const std::shared_ptr<const ImplicitFunction> function = as_function(target, "target");
  const std::vector<Landmark> pairs = as_landmarks(landmarks);
  const WrapSolution solution = run_long(
      task, [&](const Progress& progress) { return wrap(samples, *function, pairs, options, progress); });
  py::object field = py::cast(solution.field);
  const WrapReport& r = solution.report;
  attach_report(
      field,
      make_report("WrapReport", "to_target_mean"_a = r.to_target_mean, "to_target_95"_a = r.to_target_95,
                  "from_target_mean"_a = r.from_target_mean, "from_target_95"_a = r.from_target_95,
                  "matched_share"_a = r.matched_share, "landmarks"_a = py::tuple(py::cast(r.landmarks)),
                  "diagonal"_a = r.diagonal, "scale"_a = r.scale, "iterations"_a = r.iterations,
                  "seconds"_a = r.seconds, "notes"_a = py::tuple(py::cast(r.warnings)),
                  **field_measures(r.arap, r.distortion)));
  return field;
}

}  // namespace

void bind_wrap(py::module_& module) {
  module.def("wrap", &wrap_samples, "samples"_a, "target"_a, "landmarks"_a = py::tuple(),
             py::arg_v("options", WrapOptions(), "WrapOptions()"), py::kw_only(), "task"_a = py::none(), R"(
The DeformationField that lays a surface onto the zero surface of `target`, as rigidly as possible.

`target` is an ImplicitFunction: a MeshSdf, which may be open and broken, a NeuralSdf, or a subclass of your
own. The surface is first moved, rotated and scaled as a whole, then deformed in stages of falling stiffness.
`landmarks` are pairs (rest, on_target) of corresponding points (3,). Without them the best of many rotations
is taken, which suits shapes that are alike.

Parts without a counterpart on an open target follow their neighbours. The samples' weights set where the
surface is stiffer. field.report is a WrapReport. Raises InvalidInput and Cancelled.)");
}

}  // namespace arapfields::python
