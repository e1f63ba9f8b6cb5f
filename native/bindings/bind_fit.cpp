// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "neural/fit.h"

namespace arapfields::python {
namespace {

const char* stopped_by_name(StopReason reason) {
  switch (reason) {
    case StopReason::time_budget:
      return "time_budget";
    case StopReason::target:
      return "target_error";
    case StopReason::divergence:
      return "diverged";
    case StopReason::iterations:
      break;
  }
  return "iterations";
}

py::object with_report(const FitResult& result) {
  const FitReport& r = result.report;
  py::object sdf = py::cast(result.sdf);
  sdf.attr("_report") =
      py::dict("near_mean"_a = r.near_mean, "near_max"_a = r.near_max, "volume_mean"_a = r.volume_mean,
               "volume_max"_a = r.volume_max, "scale"_a = r.scale, "iterations"_a = r.iterations,
               "seconds"_a = r.seconds, "distance_seconds"_a = r.distance_seconds,
               "stopped_by"_a = stopped_by_name(r.stopped_by), "device"_a = r.device);
  return sdf;
}

py::object fit(const py::object& vertices, const py::object& triangles,
               const std::optional<FitOptions>& options, Task* task) {
  const Points v = as_points(vertices, "vertices");
  const Triangles f = as_triangles(triangles, "triangles");
  try {
    return with_report(run_long(task, [&](const Progress& progress) {
      return fit_sdf(v, f, options.value_or(FitOptions()), progress);
    }));
  } catch (const FitDiverged& error) {
    raise_diverged(error, with_report(error.last_good));
  }
}

}  // namespace

void bind_fit(py::module_& module) {
  module.def(
      "fit_sdf", &fit, "vertices"_a, "triangles"_a, "options"_a = py::none(), "task"_a = py::none(),
      "A NeuralSdf that has learnt the signed distance of a triangle soup.\n\n"
      "vertices (n,3), triangles (m,3), counter-clockwise seen from outside; as signed_distance, it takes "
      "open\n"
      "and self-intersecting meshes. The frame is that of sample_mesh, larger where the mesh would leave its "
      "cube.\n"
      "Exact distances near the surface and in the cube are regressed with the mean absolute error; the "
      "hidden\n"
      "layers learn by orthogonalised momentum (Muon; Jordan et al. 2024), the rest by Adam, at a rate that\n"
      "falls linearly to zero. report: near_mean, near_max, volume_mean, volume_max (errors at held-out "
      "points,\n"
      "mesh units), scale (mesh units a cube unit), iterations, seconds, distance_seconds, stopped_by, "
      "device.\n"
      "InvalidInput for a broken mesh or option; Cancelled; Diverged, whose last_good is the state before.");
}

}  // namespace arapfields::python
