// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "bindings/reports.h"
#include "bindings/solve_arguments.h"
#include "core/task.h"
#include "fields/radial_field.h"
#include "options/stylize.h"
#include "solve/radial/radial_solver.h"

namespace arapfields::python {
namespace {

/// What Python holds: its methods may be called from any thread, and wait without the GIL.
using Live = OneAtATime<RadialSolver>;
using FieldArray = py::array_t<double>;

/// call(solver, progress) when the solver is free.
template <class Call>
auto run_alone(Live& live, Task* task, Call&& call) {
  return run_long(task, [&](const Progress& progress) {
    return live.run(progress, [&](RadialSolver& solver) { return call(solver, progress); });
  });
}

/// One 4×4 matrix, or three numbers for a point, a handle.
struct Target {
  std::string name;
  std::optional<Vec3> point;
  Mat4 pose = Mat4::Identity();
};
using Targets = std::optional<std::vector<Target>>;

Targets as_targets(const std::optional<ArraysArgument>& given) {
  if (!given) return std::nullopt;
  std::vector<Target> targets;
  for_each_item(*given, "targets", "one for each handle is needed: (4, 4), or (3,) for a point",
                sizeof(Target), [&](const py::object& item, const std::string& name) {
                  Target& target = targets.emplace_back();
                  target.name = name;
                  if (as_doubles(item, name).ndim() == 1)
                    target.point = as_vec3(item, name);
                  else
                    target.pose = as_matrix4(item, name);
                });
  return targets;
}

/// The solver's handles, with new targets if there are any.
std::vector<Handle> moved_handles(const RadialSolver& live, const Targets& targets) {
  std::vector<Handle> moved = live.handles();
  if (!targets) return moved;
  const std::string allowed = "one for each of the " + std::to_string(moved.size()) +
                              " handles is needed: (4, 4), or (3,) for a point";
  require(targets->size() == moved.size(), "targets", std::to_string(targets->size()) + " of them", allowed);
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const Target& target = (*targets)[i];
    const bool point = moved[i].kind == Handle::Kind::point;
    require(point == target.point.has_value(), target.name, target.point ? "three numbers" : "a matrix",
            allowed);
    if (point)
      moved[i].target_point = *target.point;
    else
      moved[i].target = target.pose;
  }
  return moved;
}

LiveReportResult as_python(const RadialReport& r) {
  return make_report(
      "LiveReport", "energy"_a = r.arap.energy, "value"_a = r.value, "handle_error_mean"_a = r.handle_mean,
      "handle_error_max"_a = r.handle_max, "max_stretch"_a = r.distortion.max_stretch,
      "min_stretch"_a = r.distortion.min_stretch, "iterations"_a = r.iterations,
      "evaluations"_a = r.evaluations, "converged"_a = r.converged, "seconds"_a = r.seconds,
      "setup_seconds"_a = r.setup_seconds, "notes"_a = py::tuple(py::cast(r.warnings)),
      "preference"_a = r.preference, "contact"_a = contact_report(r.contact), "terms"_a = terms_of(r.terms),
      "kinetic"_a = r.kinetic, "speed"_a = r.speed, **field_measures(r.arap, r.distortion));
}

/// The field and report that call(solver, progress) leaves.
template <class Call>
RadialFieldResult field_after(Live& live, Task* task, Call&& call) {
  const auto [shape, report] = run_alone(live, task, [&](RadialSolver& solver, const Progress& progress) {
    call(solver, progress);
    return std::pair(solver.field(), solver.report());
  });
  py::object field = py::cast(shape);
  attach_report(field, as_python(report));
  return field;
}

void require_limits(Index iterations, double tolerance) {
  require(iterations >= 0, "iterations", std::to_string(iterations), "0 (the options') or more is allowed");
  require(tolerance >= 0.0 && tolerance < 1.0, "tolerance", std::to_string(tolerance),
          "0 (the options') or a share below 1 is allowed");
}

RadialFieldResult solved_field(Live& live, const std::optional<ArraysArgument>& targets, Index iterations,
                               double tolerance, Task* task) {
  require_limits(iterations, tolerance);
  const Targets there = as_targets(targets);
  return field_after(live, task, [&](RadialSolver& solver, const Progress& progress) {
    if (there) solver.set_targets(moved_handles(solver, there));
    solver.solve(iterations, tolerance, progress);
  });
}

Index follow(Live& live, const std::optional<ArraysArgument>& targets, Index iterations, double tolerance,
             Task* task) {
  require_limits(iterations, tolerance);
  const Targets there = as_targets(targets);
  return run_alone(live, task, [&](RadialSolver& solver, const Progress& progress) {
    if (there) solver.set_targets(moved_handles(solver, there));
    return solver.follow(iterations, tolerance, progress);
  });
}

RadialFieldResult step(Live& live, const std::optional<ArraysArgument>& targets, double seconds,
                       const std::optional<ArrayArgument>& coordinates, Task* task) {
  const Mat4 motion = coordinates ? as_matrix4(*coordinates, "coordinates") : Mat4(Mat4::Identity());
  const Targets there = as_targets(targets);
  return field_after(live, task, [&](RadialSolver& solver, const Progress& progress) {
    solver.step(moved_handles(solver, there), seconds, progress, motion);
  });
}

void set_secondary_motion(Live& live, const std::optional<SecondaryMotionOptions>& options,
                          const std::optional<ArrayArgument>& masses, const std::optional<ArrayArgument>& up,
                          const std::optional<double>& ground, Task* task) {
  std::optional<SecondaryMotion> motion;
  if (options) {
    motion = SecondaryMotion{*options, as_vector(masses, "masses")};
    if (up) motion->up = as_vec3(*up, "up");
    motion->ground = ground;
  }
  run_alone(live, task, [&](RadialSolver& solver, const Progress& progress) {
    solver.set_secondary_motion(motion, progress);
  });
}

void set_style(Live& live, const std::optional<NormalsArgument>& normals, double strength, double sharpness,
               const std::optional<ArrayArgument>& weights, const std::optional<ArrayArgument>& up) {
  if (!normals)
    return run_alone(live, nullptr, [](RadialSolver& solver, const Progress&) { solver.clear_style(); });
  const Style style = as_style(*normals);
  const Vector blend = as_vector(weights, "weights");
  const Vec3 upwards = up ? as_vec3(*up, "up") : Vec3(Vec3::UnitZ());
  run_alone(live, nullptr, [&](RadialSolver& solver, const Progress&) {
    solver.set_style(style, strength, sharpness, blend, upwards);
  });
}

py::typing::Dict<py::str, FieldArray> arrays_of(const RadialField& field) {
  const RadialBasis& basis = field.basis();
  const Index count = basis.center_count();
  py::typing::Dict<py::str, FieldArray> arrays;
  arrays["centers"] = basis.centers, arrays["radii"] = basis.radii;
  arrays["coefficients"] = RowMatrix<double>(field.coefficients().topRows(count));
  arrays["affine"] = RowMatrix<double>(field.coefficients().bottomRows(4));
  if (basis.embedding) {
    const InteriorEmbedding& embedding = *basis.embedding;
    arrays["embedded"] = basis.embedded, arrays["nodes"] = embedding.nodes;
    arrays["values"] = embedding.values, arrays["slopes"] = embedding.slopes;
    arrays["width"] = Vector::Constant(1, embedding.width);
    for (const EmbeddingPart& part : embedding.parts) arrays["fine_nodes"] = part.embedding.nodes;
  }
  if (field.influence()) {
    arrays["places"] = field.influence()->places(), arrays["reaches"] = field.influence()->reaches();
    if (field.influence()->embedding()) arrays["embedded_places"] = field.influence()->embedded();
  }
  return arrays;
}

}  // namespace

void bind_radial(py::module_& module) {
  py::class_<RadialField, DeformationField, std::shared_ptr<RadialField>>(
      module, "RadialField",
      "A deformation as a sum of compactly supported radial functions and an affine map.")
      .def_property_readonly(
          "centers", [](const RadialField& f) { return f.basis().center_count(); }, "Number of centers.")
      .def("arrays", &arrays_of, R"(
Copies of all numbers that make the field, to evaluate it elsewhere; in the coordinates of the frame's cube.

f(x) = Σ coefficients[m] φ(|x − centers[m]|² / radii[m]²) + affine[0] + x · affine[1:], φ(s) = (1 − s/6)₊⁶.
Where distances are interior, |ψ(x) − embedded[m]|² joins the squared distance. ψ is the mean of
values[i] + slopes[i].reshape(3, 3) · (x − nodes[i]), weighed by exp(−|x − nodes[i]|² / width²). Where there
are `fine_nodes`, those of fine parts such as a figure's fingers, ψ is another one there, which these do not give.
Handles with a reach add their places and reaches, as `deform` confines what they move.)");
  py::class_<MotionState>(module, "MotionState", R"(
Position, velocity and acceleration of a LiveDeformer: with the targets, all that its next step depends on.

It fits any LiveDeformer with the same samples, options and number of handles.)")
      .def_readonly("coefficients", &MotionState::coefficients,
                    "(n, 3) coefficients of the centers and of the affine map.")
      .def_readonly("velocities", &MotionState::velocities, "(n, 3) per second.")
      .def_readonly("accelerations", &MotionState::accelerations,
                    "(n, 3) per second squared; (0, 3) at rest.");
  py::class_<Live>(module, "LiveDeformer", R"(
Deforms a surface at interactive rates: when handles move, solve() continues from the last shape.

The energy is that of deform (stretch, bend, handles, locality), or with a style that of stylize, over a radial field.
L-BFGS preconditioned with the factored stiffness of the rest surface minimises it. Any thread
may call it: one at a time works, the others wait.)")
      .def(py::init([](const SurfaceSamples& samples, const HandlesArgument& handles, LiveOptions options,
                       const std::optional<Contact>& contact, Task* task) {
             const auto held = as_handles(handles);
             return run_long(task, [&](const Progress& progress) {
               auto live = std::make_unique<Live>(samples, held, options, progress);
               live->run(progress,
                         [&](RadialSolver& solver) { solver.set_contact(contact, false, progress); });
               return live;
             });
           }),
           "samples"_a, "handles"_a = py::tuple(), py::arg_v("options", LiveOptions(), "LiveOptions()"),
           py::kw_only(), "contact"_a = py::none(), "task"_a = py::none(), R"(
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
          [](Live& live, const ArrayArgument& points, const std::optional<ArrayArgument>& triangles) {
            const Points mesh = as_points(points, "points");
            const auto faces = triangles
                                   ? std::make_shared<const Triangles>(as_triangles(*triangles, "triangles"))
                                   : nullptr;
            run_alone(live, nullptr,
                      [&](RadialSolver& solver, const Progress&) { solver.track(mesh, faces); });
          },
          "points"_a, py::kw_only(), "triangles"_a = py::none(), R"(
Prepares rest points (n, 3), such as a mesh's vertices, for tracked().

With `triangles` (m, 3) the points are a mesh's vertices: where its parts touch at rest, as closed lips do, each
vertex moves with the part that it belongs to.)")
      .def(
          "tracked",
          [](Live& live) {
            return run_alone(live, nullptr,
                             [](RadialSolver& solver, const Progress&) { return solver.tracked(); });
          },
          R"(
Current positions (n, 3) of the points given to track(), in single precision.

Several times faster than evaluating the field.)")
      .def(
          "set_handles",
          [](Live& live, const HandlesArgument& handles) {
            const std::vector<Handle> held = as_handles(handles);
            run_alone(live, nullptr,
                      [&](RadialSolver& solver, const Progress&) { solver.set_handles(held); });
          },
          "handles"_a, "Replaces the handles. The next solve starts from the current shape.")
      .def(
          "set_weights",
          [](Live& live, const std::optional<ArrayArgument>& weights,
             const std::optional<ArrayArgument>& bend_weights) {
            const Vector w = as_vector(weights, "weights"), b = as_vector(bend_weights, "bend_weights");
            run_alone(live, nullptr,
                      [&](RadialSolver& solver, const Progress&) { solver.set_weights(w, b); });
          },
          "weights"_a = py::none(), "bend_weights"_a = py::none(), R"(
Factors (n,) on the samples' energies and on their bending, from the next solve on.

They are those of SurfaceSamples.with_weights; None is 1 everywhere.)")
      .def(
          "set_symmetry",
          [](Live& live, const std::string& symmetry, Task* task) {
            SymmetryPlane plane{};
            choose(symmetry, "symmetry", plane);
            run_alone(live, task, [&](RadialSolver& solver, const Progress& progress) {
              solver.set_symmetry(plane, progress);
            });
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
           "masses"_a = py::none(), "up"_a = py::none(), "ground"_a = py::none(), "task"_a = py::none(), R"(
Gives the surface a mass from the next step() on: it lags behind its handles, overshoots and settles.

`masses` ≥ 0, one for each sample given to the constructor, distribute the mass; 0 follows at once. Gravity
points against `up` (3,), z unless given. `ground` is a height along `up` that the surface cannot pass.
solve() finds the rest state. None or strength 0: no mass.)")
      .def(
          "set_contact",
          [](Live& live, const std::optional<Contact>& contact, Task* task) {
            run_alone(live, task, [&](RadialSolver& solver, const Progress& progress) {
              solver.set_contact(contact, false, progress);
            });
          },
          "contact"_a, py::kw_only(), "task"_a = py::none(),
          "What the surface does not pass from the next solve on; None: nothing.")
      .def("step", &step, "targets"_a, "seconds"_a, py::kw_only(), "coordinates"_a = py::none(),
           "task"_a = py::none(), R"(
Moves the handles to `targets` within `seconds` (1e-5 to 10) and integrates the surface's motion.

`targets` is as in solve(); None holds the handles still. The step starts from the state after the last step
or solve; a solve ends at rest. Where the coordinate system itself has moved since the last step,
`coordinates` (4, 4) maps its old coordinates to the new ones, and the surface feels that motion. Without
set_secondary_motion() this is solve(targets). The same steps from the same start give the same bits. Where
it raises, the state is unchanged.)")
      .def_property(
          "motion_state",
          [](Live& live) {
            return run_alone(live, nullptr,
                             [](RadialSolver& solver, const Progress&) { return solver.motion_state(); });
          },
          [](Live& live, const MotionState& state) {
            run_alone(live, nullptr,
                      [&](RadialSolver& solver, const Progress&) { solver.set_motion_state(state); });
          },
          "The current MotionState; setting it continues from there.")
      .def(
          "reset",
          [](Live& live) {
            run_alone(live, nullptr, [](RadialSolver& solver, const Progress&) { solver.reset(); });
          },
          "Back to the identity, with the handles at rest.")
      .def_property_readonly(
          "field", [](Live& live) { return field_after(live, nullptr, [](auto&, const Progress&) {}); },
          "The current deformation, as a DeformationField.")
      .def_property_readonly(
          "report",
          [](Live& live) {
            return as_python(run_alone(
                live, nullptr, [](RadialSolver& solver, const Progress&) { return solver.report(); }));
          },
          "The LiveReport of the last solve or step.");

  testing_module(module).def(
      "field_jets", [](const DeformationField& field, const Points& cube_points, int count) {
        JetArray<double> jets({py::ssize_t{count}, py::ssize_t{cube_points.rows()}, py::ssize_t{3}});
        field.evaluate(cube_points, jet_view<double>(jets));
        return jets;
      });
}

}  // namespace arapfields::python
