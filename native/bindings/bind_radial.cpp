// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/handles.h"
#include "bindings/jet_arrays.h"
#include "bindings/reports.h"
#include "bindings/styles.h"
#include "options/stylize.h"
#include "solve/radial/radial_solver.h"

namespace arapfields::python {
namespace {

/// The solver's handles with new targets: one 4×4 matrix, or three numbers for a point, a handle.
std::vector<Handle> moved_handles(const RadialSolver& live, const py::object& targets) {
  std::vector<Handle> moved = live.handles();
  const std::string allowed = "one for each of the " + std::to_string(moved.size()) +
                              " handles is needed: (4, 4), or (3,) for a point";
  std::size_t i = 0;
  for_each_item(targets, "targets", allowed, 0.0, [&](const py::object& target, const std::string& name) {
    require(i < moved.size(), "targets", "there are more of them", allowed);
    if (moved[i].kind == Handle::Kind::point)
      moved[i].target_point = as_vec3(target, name);
    else
      moved[i].target = as_matrix4(target, name);
    ++i;
  });
  require(i == moved.size(), "targets", std::to_string(i) + " of them", allowed);
  return moved;
}

LiveReportResult report(const RadialSolver& live) {
  const RadialReport& r = live.report();
  return make_report("LiveReport", "energy"_a = r.arap.energy, "value"_a = r.value,
                     "handle_error_mean"_a = r.handle_mean, "handle_error_max"_a = r.handle_max,
                     "max_stretch"_a = r.distortion.max_stretch, "min_stretch"_a = r.distortion.min_stretch,
                     "iterations"_a = r.iterations, "evaluations"_a = r.evaluations,
                     "converged"_a = r.converged, "seconds"_a = r.seconds,
                     "setup_seconds"_a = r.setup_seconds, "notes"_a = py::tuple(py::cast(r.warnings)),
                     "preference"_a = r.preference, "kinetic"_a = r.kinetic, "speed"_a = r.speed,
                     **field_measures(r.arap, r.distortion));
}

RadialFieldResult with_report(const RadialSolver& live) {
  py::object field = py::cast(live.field());
  attach_report(field, report(live));
  return field;
}

/// Checks the limits of a solve and sets its targets.
void prepare(RadialSolver& live, const std::optional<ArraysArgument>& targets, Index iterations,
             double tolerance) {
  require(iterations >= 0, "iterations", std::to_string(iterations), "0 (the options') or more is allowed");
  require(tolerance >= 0.0 && tolerance < 1.0, "tolerance", std::to_string(tolerance),
          "0 (the options') or a share below 1 is allowed");
  if (targets) live.set_targets(moved_handles(live, *targets));
}

RadialFieldResult solved_field(RadialSolver& live, const std::optional<ArraysArgument>& targets,
                               Index iterations, double tolerance, Task* task) {
  prepare(live, targets, iterations, tolerance);
  run_long(task, [&](const Progress& progress) { return live.solve(iterations, tolerance, progress); });
  return with_report(live);
}

Index follow(RadialSolver& live, const std::optional<ArraysArgument>& targets, Index iterations,
             double tolerance, Task* task) {
  prepare(live, targets, iterations, tolerance);
  return run_long(task,
                  [&](const Progress& progress) { return live.follow(iterations, tolerance, progress); });
}

RadialFieldResult step(RadialSolver& live, const std::optional<ArraysArgument>& targets, double seconds,
                       const std::optional<ArrayArgument>& coordinates, Task* task) {
  const Mat4 motion = coordinates ? as_matrix4(*coordinates, "coordinates") : Mat4(Mat4::Identity());
  const std::vector<Handle> moved = targets ? moved_handles(live, *targets) : live.handles();
  run_long(task, [&](const Progress& progress) { return live.step(moved, seconds, progress, motion); });
  return with_report(live);
}

void set_secondary_motion(RadialSolver& live, const std::optional<SecondaryMotionOptions>& options,
                          const std::optional<ArrayArgument>& masses, const std::optional<ArrayArgument>& up,
                          const std::optional<double>& ground) {
  if (!options) return live.set_secondary_motion(std::nullopt);
  SecondaryMotion motion{*options};
  motion.masses = as_vector(masses, "masses");
  if (up) motion.up = as_vec3(*up, "up");
  motion.ground = ground;
  live.set_secondary_motion(motion);
}

void set_style(RadialSolver& live, const std::optional<NormalsArgument>& normals, double strength,
               double sharpness, const std::optional<ArrayArgument>& weights,
               const std::optional<ArrayArgument>& up) {
  if (!normals) return live.clear_style();
  const Style style = as_style(*normals);
  const Vector blend = as_vector(weights, "weights");
  const Vec3 upwards = up ? as_vec3(*up, "up") : Vec3(Vec3::UnitZ());
  run_long([&] { live.set_style(style, strength, sharpness, blend, upwards); });
}

}  // namespace

void bind_radial(py::module_& module) {
  py::class_<RadialField, DeformationField, std::shared_ptr<RadialField>>(
      module, "RadialField",
      "A deformation as a sum of compactly supported radial functions and an affine map.")
      .def_property_readonly(
          "centers", [](const RadialField& f) { return f.basis().center_count(); }, "Number of centers.");
  py::class_<MotionState>(module, "MotionState", R"(
Position, velocity and acceleration of a LiveDeformer: with the targets, all that its next step depends on.

It fits any LiveDeformer with the same samples, options and number of handles.)")
      .def_readonly("coefficients", &MotionState::coefficients,
                    "(n, 3) coefficients of the centers and of the affine map.")
      .def_readonly("velocities", &MotionState::velocities, "(n, 3) per second.")
      .def_readonly("accelerations", &MotionState::accelerations,
                    "(n, 3) per second squared; (0, 3) at rest.");
  py::class_<RadialSolver>(module, "LiveDeformer", R"(
Deforms a surface at interactive rates: when handles move, solve() continues from the last shape.

The energy is that of deform (stretch, bend, handles), or with a style that of stylize, over a radial field.
L-BFGS preconditioned with the factored stiffness of the rest surface minimises it. Not thread-safe: one
caller at a time.)")
      .def(py::init([](const SurfaceSamples& samples, const HandlesArgument& handles,
                       const LiveOptions& options, Task* task) {
             const auto held = as_handles(handles);
             return run_long(task, [&](const Progress& progress) {
               return std::make_unique<RadialSolver>(samples, held, options, progress);
             });
           }),
           "samples"_a, "handles"_a = py::tuple(), py::arg_v("options", LiveOptions(), "LiveOptions()"),
           py::kw_only(), "task"_a = py::none(), R"(
samples: SurfaceSamples at rest. handles: CuboidHandle, PointHandle or RegionHandle in mesh coordinates; with
none, for a style alone, the lowest sample is held. InvalidInput names the handle or option that does not fit.)")
      .def("solve", &solved_field, "targets"_a = py::none(), py::kw_only(), "iterations"_a = 0,
           "tolerance"_a = 0.0, "task"_a = py::none(), R"(
Moves the handles to `targets` and returns the DeformationField there.

`targets` has a 4×4 matrix for each handle, (3,) for a point; None keeps the current ones. `iterations` and
`tolerance` replace the options' for this call. To finish a drag, use iterations=100, tolerance=1e-6.)")
      .def("follow", &follow, "targets"_a = py::none(), py::kw_only(), "iterations"_a = 0,
           "tolerance"_a = 0.0, "task"_a = py::none(), R"(
As solve(), for callers that need tracked() alone: it makes no field, and measures the report on demand.

Returns the number of iterations, fewer than `iterations` where the solve has converged.)")
      .def(
          "track",
          [](RadialSolver& live, const ArrayArgument& points) {
            const Points mesh = as_points(points, "points");
            run_long([&] { live.track(mesh); });
          },
          "points"_a, "Prepares rest points (n, 3), such as a mesh's vertices, for tracked().")
      .def(
          "tracked", [](const RadialSolver& live) { return run_long([&] { return live.tracked(); }); }, R"(
Current positions (n, 3) of the points given to track(), in single precision.

Several times faster than evaluating the field.)")
      .def(
          "set_handles",
          [](RadialSolver& live, const HandlesArgument& handles) { live.set_handles(as_handles(handles)); },
          "handles"_a, "Replaces the handles. The next solve starts from the current shape.")
      .def(
          "set_weights",
          [](RadialSolver& live, const std::optional<ArrayArgument>& weights,
             const std::optional<ArrayArgument>& bend_weights) {
            const Vector w = as_vector(weights, "weights"), b = as_vector(bend_weights, "bend_weights");
            run_long([&] { live.set_weights(w, b); });
          },
          "weights"_a = py::none(), "bend_weights"_a = py::none(), R"(
Factors (n,) on the samples' energies and on their bending, from the next solve on.

They are those of SurfaceSamples.with_weights; None is 1 everywhere.)")
      .def(
          "set_symmetry",
          [](RadialSolver& live, const std::string& symmetry, Task* task) {
            SymmetryPlane plane{};
            choose(symmetry, "symmetry", plane);
            run_long(task, [&](const Progress& progress) { live.set_symmetry(plane, progress); });
          },
          "symmetry"_a, py::kw_only(), "task"_a = py::none(), R"(
Makes deformations symmetric across the plane where 'x', 'y' or 'z' is 0; 'none' ends that.

The next solve starts from the current shape. Takes as long as a new LiveDeformer.)")
      .def("set_style", &set_style, "normals"_a, "strength"_a = StylizeOptions().strength, py::kw_only(),
           "sharpness"_a = StylizeOptions().sharpness, "weights"_a = py::none(), "up"_a = py::none(), R"(
Turns the surface towards preferred normals from the next solve on.

`normals` is an array (k, 3), a preset's name or an ObjectStyle; None or strength 0 removes the style.
`weights` scale the effect at each sample given to the constructor. Without handles the figure stands on its
lowest sample along `up` (3,), z unless given.)")
      .def("set_secondary_motion", &set_secondary_motion,
           py::arg_v("options", SecondaryMotionOptions(), "SecondaryMotionOptions()"), py::kw_only(),
           "masses"_a = py::none(), "up"_a = py::none(), "ground"_a = py::none(), R"(
Gives the surface a mass from the next step() on: it lags behind its handles, overshoots and settles.

`masses` ≥ 0, one for each sample given to the constructor, distribute the mass; 0 follows at once. Gravity
points against `up` (3,), z unless given. `ground` is a height along `up` that the surface cannot pass.
solve() finds the rest state. None or strength 0: no mass.)")
      .def("step", &step, "targets"_a, "seconds"_a, py::kw_only(), "coordinates"_a = py::none(),
           "task"_a = py::none(), R"(
Moves the handles to `targets` within `seconds` (1e-5 to 10) and integrates the surface's motion.

`targets` is as in solve(); None holds the handles still. The step starts from the state after the last step
or solve; a solve ends at rest. Where the coordinate system itself has moved since the last step,
`coordinates` (4, 4) maps its old coordinates to the new ones, and the surface feels that motion. Without
set_secondary_motion() this is solve(targets). The same steps from the same start give the same bits. Where
it raises, the state is unchanged.)")
      .def_property("motion_state", &RadialSolver::motion_state, &RadialSolver::set_motion_state,
                    "The current MotionState; setting it continues from there.")
      .def("reset", &RadialSolver::reset, "Back to the identity, with the handles at rest.")
      .def_property_readonly("field", &with_report, "The current deformation, as a DeformationField.")
      .def_property_readonly("report", &report, "The LiveReport of the last solve or step.");
  testing_module(module).def(
      "field_jets", [](const DeformationField& field, const Points& cube_points, int count) {
        JetArray<double> jets({py::ssize_t{count}, py::ssize_t{cube_points.rows()}, py::ssize_t{3}});
        field.evaluate(cube_points, jet_view<double>(jets));
        return jets;
      });
}

}  // namespace arapfields::python
