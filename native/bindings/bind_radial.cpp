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
  return make_report(
      "LiveReport",
      py::dict("stretch"_a = r.arap.stretch, "bend"_a = r.arap.bend, "energy"_a = r.arap.energy,
               "value"_a = r.value, "handle_error_mean"_a = r.handle_mean,
               "handle_error_max"_a = r.handle_max, "min_determinant"_a = r.distortion.min_determinant,
               "flipped_share"_a = r.distortion.flipped_share, "max_stretch"_a = r.distortion.max_stretch,
               "min_stretch"_a = r.distortion.min_stretch, "iterations"_a = r.iterations,
               "evaluations"_a = r.evaluations, "converged"_a = r.converged, "seconds"_a = r.seconds,
               "setup_seconds"_a = r.setup_seconds, "notes"_a = py::tuple(py::cast(r.warnings)),
               "preference"_a = r.preference, "kinetic"_a = r.kinetic, "speed"_a = r.speed));
}

RadialFieldResult with_report(const RadialSolver& live) {
  py::object field = py::cast(live.field());
  attach_report(field, report(live));
  return field;
}

void set_out(RadialSolver& live, const std::optional<ArraysArgument>& targets, Index iterations,
             double tolerance) {
  require(iterations >= 0, "iterations", std::to_string(iterations), "0 (the options') or more is allowed");
  require(tolerance >= 0.0 && tolerance < 1.0, "tolerance", std::to_string(tolerance),
          "0 (the options') or a share below 1 is allowed");
  if (targets) live.set_targets(moved_handles(live, *targets));
}

RadialFieldResult solved_field(RadialSolver& live, const std::optional<ArraysArgument>& targets,
                               Index iterations, double tolerance, Task* task) {
  set_out(live, targets, iterations, tolerance);
  run_long(task, [&](const Progress& progress) { return live.solve(iterations, tolerance, progress); });
  return with_report(live);
}

Index follow(RadialSolver& live, const std::optional<ArraysArgument>& targets, Index iterations,
             double tolerance, Task* task) {
  set_out(live, targets, iterations, tolerance);
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
  if (masses) motion.masses = as_vector(*masses, "masses");
  if (up) motion.up = as_vec3(*up, "up");
  motion.ground = ground;
  live.set_secondary_motion(motion);
}

void set_style(RadialSolver& live, const std::optional<NormalsArgument>& normals, double strength,
               double sharpness, const std::optional<ArrayArgument>& weights,
               const std::optional<ArrayArgument>& up) {
  if (!normals) return live.clear_style();
  const Style style = as_style(*normals);
  const Vector blend = weights ? as_vector(*weights, "weights") : Vector();
  const Vec3 upwards = up ? as_vec3(*up, "up") : Vec3(Vec3::UnitZ());
  run_long(nullptr, [&](const Progress&) { live.set_style(style, strength, sharpness, blend, upwards); });
}

}  // namespace

void bind_radial(py::module_& module) {
  py::class_<RadialField, DeformationField, std::shared_ptr<RadialField>>(
      module, "RadialField", "A deformation as a sum of compact centers and an affine map.")
      .def_property_readonly(
          "centers", [](const RadialField& f) { return f.basis().center_count(); }, "Number of centers.");
  py::class_<MotionState>(module, "MotionState",
                          "All that the next step of a LiveDeformer depends on beside its targets. It fits a "
                          "solver of the\nsame samples, options and number of handles.")
      .def_readonly("coefficients", &MotionState::coefficients, "(n, 3), of the centers and an affine map.")
      .def_readonly("velocities", &MotionState::velocities, "(n, 3), a second.")
      .def_readonly("accelerations", &MotionState::accelerations,
                    "(n, 3), a second squared; (0, 3) at rest.");
  py::class_<RadialSolver>(
      module, "LiveDeformer",
      "Deforms a surface at interactive rates: handles move, solve() follows from the last shape.\n\n"
      "The energy is that of deform (METHOD: stretch, true bend, handles), of a style as in stylize, over a\n"
      "radial field; L-BFGS preconditioned by the factored stiffness of the rest surface minimises it. An\n"
      "object serves one caller at a time.")
      .def(py::init([](const SurfaceSamples& samples, const HandlesArgument& handles,
                       const LiveOptions& options, Task* task) {
             const auto held = as_handles(handles);
             return run_long(task, [&](const Progress& progress) {
               return std::make_unique<RadialSolver>(samples, held, options, progress);
             });
           }),
           "samples"_a, "handles"_a = py::tuple(), py::arg_v("options", LiveOptions(), "LiveOptions()"),
           py::kw_only(), "task"_a = py::none(),
           "samples: SurfaceSamples; handles: CuboidHandle, PointHandle or RegionHandle in mesh coordinates "
           "(none: for a style\n"
           "alone; the lowest sample is then held). InvalidInput names the handle or option that does not "
           "fit.")
      .def("solve", &solved_field, "targets"_a = py::none(), py::kw_only(), "iterations"_a = 0,
           "tolerance"_a = 0.0, "task"_a = py::none(),
           "Follows the handles to `targets` (a 4×4 matrix a handle, three numbers for a point; None: where\n"
           "they are) and returns a DeformationField of its own. `iterations` and `tolerance` replace the "
           "options' for\n"
           "this call, for instance to finish a drag: iterations=100, tolerance=1e-6.")
      .def("follow", &follow, "targets"_a = py::none(), py::kw_only(), "iterations"_a = 0,
           "tolerance"_a = 0.0, "task"_a = py::none(),
           "As solve, for who asks for tracked() alone: makes no field, and measures the report when it is\n"
           "asked for. Returns the steps taken; fewer than `iterations` where no more are needed.")
      .def(
          "track",
          [](RadialSolver& live, const ArrayArgument& points) {
            const Points mesh = as_points(points, "points");
            run_long(nullptr, [&](const Progress&) { live.track(mesh); });
          },
          "points"_a, "Prepares points (n, 3), a mesh's vertices for instance, for tracked().")
      .def(
          "tracked",
          [](const RadialSolver& live) {
            return run_long(nullptr, [&](const Progress&) { return live.tracked(); });
          },
          "Where the deformation at hand takes the points given to track: (n, 3), single precision. Several\n"
          "times faster than the field itself.")
      .def(
          "set_handles",
          [](RadialSolver& live, const HandlesArgument& handles) { live.set_handles(as_handles(handles)); },
          "handles"_a,
          "Other handles for the same surface; the shape at hand is kept as the start of the next solve.")
      .def(
          "set_weights",
          [](RadialSolver& live, const std::optional<ArrayArgument>& weights,
             const std::optional<ArrayArgument>& bend_weights) {
            const Vector w = weights ? as_vector(*weights, "weights") : Vector();
            const Vector b = bend_weights ? as_vector(*bend_weights, "bend_weights") : Vector();
            run_long(nullptr, [&](const Progress&) { live.set_weights(w, b); });
          },
          "weights"_a = py::none(), "bend_weights"_a = py::none(),
          "How stiff each sample is (n,), and how stiff against bending (n,), from the next solve on, as in\n"
          "SurfaceSamples.with_weights; None: 1 everywhere.")
      .def(
          "set_symmetry",
          [](RadialSolver& live, const std::string& symmetry, Task* task) {
            SymmetryPlane plane{};
            choose(symmetry, "symmetry", plane);
            run_long(task, [&](const Progress& progress) { live.set_symmetry(plane, progress); });
          },
          "symmetry"_a, py::kw_only(), "task"_a = py::none(),
          "Both sides of the plane on which 'x', 'y' or 'z' is 0 move alike from the next solve on, or with\n"
          "'none' each for itself; the shape at hand is the start. Takes as long as a new LiveDeformer.")
      .def("set_style", &set_style, "normals"_a, "strength"_a = StylizeOptions().strength, py::kw_only(),
           "sharpness"_a = StylizeOptions().sharpness, "weights"_a = py::none(), "up"_a = py::none(),
           "Turns the surface towards preferred normals, (k, 3), a style's name or an ObjectStyle, from the "
           "next\n"
           "solve on; None\n"
           "or strength 0: no style. `weights` (one for each sample given at the start) blend the effect; "
           "`up`\n"
           "(3,), else z, is where the figure's head is: without handles it stands on what lies lowest.")
      .def("set_secondary_motion", &set_secondary_motion,
           py::arg_v("options", SecondaryMotionOptions(), "SecondaryMotionOptions()"), py::kw_only(),
           "masses"_a = py::none(), "up"_a = py::none(), "ground"_a = py::none(),
           "From the next step() on the surface has a mass: it lags behind its handles, overshoots and "
           "settles. `masses`\n"
           "(one for each sample given at the start, none negative) say how much of it each place has; 0 "
           "follows at once.\n"
           "`up` (3,), else z, is against the gravity; `ground` is the height along it that nothing passes. "
           "solve() finds\n"
           "where all would come to rest. None or strength 0: no mass.")
      .def("step", &step, "targets"_a, "seconds"_a, py::kw_only(), "coordinates"_a = py::none(),
           "task"_a = py::none(),
           "Moves the handles to `targets` (as in solve) in so many seconds, 1e-5 to 10 (None: they hold "
           "still), and the surface with "
           "them, from\n"
           "where the last step or solve ended; a solve ends at rest. Where the object to which all\n"
           "coordinates belong has moved meanwhile, `coordinates` (4, 4) takes those of the last step to "
           "those "
           "of this one:\n"
           "the surface feels it. Without set_secondary_motion, "
           "solve(targets).\n"
           "The same steps from the same start give the same bits. Where it raises, nothing has moved.")
      .def_property("motion_state", &RadialSolver::motion_state, &RadialSolver::set_motion_state,
                    "Where the surface is and how it moves, as a MotionState; set it to go on from there.")
      .def("reset", &RadialSolver::reset, "Back to the identity and to handles at rest.")
      .def_property_readonly("field", &with_report, "The deformation at hand, as a DeformationField.")
      .def_property_readonly(
          "report", &report,
          "What the last solve reached: energies, handle errors (mesh units), distortion.");

  testing_module(module).def(
      "field_jets", [](const DeformationField& field, const Points& cube_points, int count) {
        JetArray<double> jets({py::ssize_t{count}, py::ssize_t{cube_points.rows()}, py::ssize_t{3}});
        field.evaluate(cube_points, jet_view<double>(jets));
        return jets;
      });
}

}  // namespace arapfields::python
