// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/reports.h"
#include "neural/fit.h"

namespace arapfields::python {
namespace {

py::object with_report(const FitResult& result) {
  const FitReport& r = result.report;
  py::object sdf = py::cast(result.sdf);
  attach_report(sdf, make_report("FitReport",
                                 py::dict("near_mean"_a = r.near_mean, "near_max"_a = r.near_max,
                                          "volume_mean"_a = r.volume_mean, "volume_max"_a = r.volume_max,
                                          "scale"_a = r.scale, "iterations"_a = r.iterations,
                                          "seconds"_a = r.seconds, "distance_seconds"_a = r.distance_seconds,
                                          "stopped_by"_a = name_of(r.stopped_by), "device"_a = r.device)));
  return sdf;
}

NeuralSdfResult fit(const ArrayArgument& vertices, const ArrayArgument& triangles, const FitOptions& options,
                    const std::optional<CallbackArgument>& callback, Task* task) {
  const Points v = as_points(vertices, "vertices");
  const Triangles f = as_triangles(triangles, "triangles");
  const IterationObserver observer = as_observer(callback.value_or(py::none()));
  try {
    return with_report(
        run_long(task, [&](const Progress& progress) { return fit_sdf(v, f, options, progress, observer); }));
  } catch (const FitDiverged& error) {
    raise_diverged(error, with_report(error.last_good));
  }
}

}  // namespace

void bind_fit(py::module_& module) {
  module.def(
      "fit_sdf", &fit, "vertices"_a, "triangles"_a, py::arg_v("options", FitOptions(), "FitOptions()"),
      py::kw_only(), "callback"_a = py::none(), "task"_a = py::none(),
      "A NeuralSdf that has learnt the signed distance of a triangle soup.\n\n"
      "vertices (n,3), triangles (m,3), counter-clockwise seen from outside; as signed_distance, it takes "
      "open\n"
      "and self-intersecting meshes. The frame is that of sample_mesh, larger where the mesh would leave its "
      "cube.\n"
      "Exact distances near the surface and in the cube are regressed with the mean absolute error; the "
      "hidden\n"
      "layers learn by orthogonalised momentum (Muon; Jordan et al. 2024), the rest by Adam, at a rate that\n"
      "falls linearly to zero. `callback` is told of each Iteration, whose one term is error, and ends the "
      "fit\n"
      "by raising StopIteration. report: a FitReport.\n"
      "InvalidInput for a broken mesh or option; Cancelled; Diverged, whose last_good is the state before.");
}

}  // namespace arapfields::python
