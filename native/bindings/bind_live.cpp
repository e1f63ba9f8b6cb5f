// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "energies/styles.h"
#include "options/stylize.h"
#include "solve/live_solver.h"

namespace arapfields::python {
namespace {

/// The solver's handles with new targets: one 4×4 matrix, or three numbers for a point, a handle.
std::vector<Handle> moved_handles(const LiveSolver& live, const py::sequence& targets) {
  std::vector<Handle> moved = live.handles();
  require(moved.size() == targets.size(), "targets", std::to_string(targets.size()) + " of them",
          "one for each of the " + std::to_string(moved.size()) + " handles is needed");
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const std::string name = "targets[" + std::to_string(i) + "]";
    if (moved[i].kind == Handle::Kind::point)
      moved[i].target_point = as_vec3(targets[i], name);
    else
      moved[i].target = as_matrix4(targets[i], name);
  }
  return moved;
}

py::dict report_dict(const LiveReport& report) {
  py::dict result(
      "stretch"_a = report.arap.stretch, "bend"_a = report.arap.bend, "energy"_a = report.arap.energy,
      "value"_a = report.value, "handle_error_mean"_a = report.handle_mean,
      "handle_error_max"_a = report.handle_max, "min_determinant"_a = report.distortion.min_determinant,
      "flipped_share"_a = report.distortion.flipped_share, "max_stretch"_a = report.distortion.max_stretch,
      "min_stretch"_a = report.distortion.min_stretch, "iterations"_a = report.iterations,
      "evaluations"_a = report.evaluations, "converged"_a = report.converged, "seconds"_a = report.seconds,
      "setup_seconds"_a = report.setup_seconds, "notes"_a = report.notes);
  if (report.preference) result["preference"] = *report.preference;
  return result;
}

py::object with_report(const LiveSolver& live) {
  py::object field = py::cast(std::static_pointer_cast<DeformationField>(live.field()));
  field.attr("_report") = report_dict(live.report());
  return field;
}

py::object solve(LiveSolver& live, const py::object& targets, Index iterations, double tolerance,
                 Task* task) {
  require(iterations >= 0, "iterations", std::to_string(iterations), "0 (the options') or more is allowed");
  require(tolerance >= 0.0 && tolerance < 1.0, "tolerance", std::to_string(tolerance),
          "0 (the options') or a share below 1 is allowed");
  if (!targets.is_none()) live.set_targets(moved_handles(live, py::cast<py::sequence>(targets)));
  run_long(task, [&](const Progress& progress) { return live.solve(iterations, tolerance, progress); });
  return with_report(live);
}

void set_style(LiveSolver& live, const py::object& normals, double strength, double sharpness,
               const py::object& weights, const py::object& up) {
  if (normals.is_none()) return live.clear_style();
  const Points preferred = py::isinstance<py::str>(normals)
                               ? preferred_normals(py::cast<std::string>(normals))
                               : as_points(normals, "normals");
  live.set_style(preferred, strength, sharpness, weights.is_none() ? Vector() : as_vector(weights, "weights"),
                 up.is_none() ? Vec3(Vec3::UnitZ()) : as_vec3(up, "up"));
}

}  // namespace

void bind_live(py::module_& module) {
  py::class_<RadialField, DeformationField, std::shared_ptr<RadialField>>(
      module, "RadialField", "A deformation as a sum of compact centers and an affine map.")
      .def_property_readonly(
          "centers", [](const RadialField& f) { return f.basis().center_count(); }, "Number of centers.");
  py::class_<LiveSolver>(
      module, "LiveDeformer",
      "Deforms a surface at interactive rates: handles move, solve() follows from the last shape.\n\n"
      "The energy is that of deform (METHOD: stretch, true bend, handles), of a style as in stylize, over a\n"
      "radial field; L-BFGS preconditioned by the factored stiffness of the rest surface minimises it. An\n"
      "object serves one caller at a time.")
      .def(
          py::init([](const SurfaceSamples& samples, const std::vector<Handle>& handles,
                      const LiveOptions& options, Task* task) {
            return run_long(task, [&](const Progress& progress) {
              return std::make_unique<LiveSolver>(samples, handles, options, progress);
            });
          }),
          "samples"_a, "handles"_a = std::vector<Handle>(),
          py::arg_v("options", LiveOptions(), "LiveOptions()"), "task"_a = nullptr,
          "samples: SurfaceSamples; handles: Cuboid, Point or Region in mesh coordinates (none: for a style\n"
          "alone; the lowest sample is then held). InvalidInput names the handle or option that does not "
          "fit.")
      .def("solve", &solve, "targets"_a = py::none(), "iterations"_a = 0, "tolerance"_a = 0.0,
           "task"_a = nullptr,
           "Follows the handles to `targets` (a 4×4 matrix a handle, three numbers for a point; None: where\n"
           "they are) and returns a DeformationField of its own. `iterations` and `tolerance` replace the "
           "options' for\n"
           "this call, for instance to finish a drag: iterations=100, tolerance=1e-6.")
      .def(
          "track",
          [](LiveSolver& live, const py::object& points) {
            const Points mesh = as_points(points, "points");
            run_long(nullptr, [&](const Progress&) { live.track(mesh); });
          },
          "points"_a, "Prepares points (n, 3), a mesh's vertices for instance, for tracked().")
      .def(
          "tracked",
          [](const LiveSolver& live) {
            return run_long(nullptr, [&](const Progress&) { return live.tracked(); });
          },
          "Where the deformation at hand takes the points given to track: (n, 3), single precision. Several\n"
          "times faster than the field itself.")
      .def("set_handles", &LiveSolver::set_handles, "handles"_a,
           "Other handles for the same surface; the shape at hand is kept as the start of the next solve.")
      .def("set_style", &set_style, "normals"_a, "strength"_a = StylizeOptions().strength,
           "sharpness"_a = StylizeOptions().sharpness, "weights"_a = py::none(), "up"_a = py::none(),
           "Turns the surface towards preferred normals, (k, 3) or a style's name, from the next solve on; "
           "None\n"
           "or strength 0: no style. `weights` (one for each sample given at the start) blend the effect; "
           "`up`\n"
           "(3,), else z, is where the figure's head is: without handles it stands on what lies lowest.")
      .def("reset", &LiveSolver::reset, "Back to the identity and to handles at rest.")
      .def_property_readonly("field", &with_report, "The deformation at hand, as a DeformationField.")
      .def_property_readonly(
          "report", [](const LiveSolver& live) { return report_dict(live.report()); },
          "What the last solve reached: energies, handle errors (mesh units), distortion.");

  testing_module(module).def(
      "field_jets", [](const DeformationField& field, const Points& cube_points, int count) {
        JetArray<double> jets({static_cast<Index>(count), cube_points.rows(), Index{3}});
        field.evaluate(cube_points, jet_view<double>(jets));
        return jets;
      });
}

}  // namespace arapfields::python
