// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "bindings/python_function.h"
#include "bindings/reports.h"
#include "bindings/solve_arguments.h"
#include "options/deform.h"
#include "solve/contact/contact.h"
#include "solve/deform.h"
#include "solve/field_measures.h"
#include "solve/stylize.h"
#include "solve/trained/inverse_training.h"
#include "solve/trained/loss_probe.h"
#include "tensors/device.h"

namespace arapfields::python {

void bind_contact(py::module_& module) {
  py::class_<Obstacle>(module, "Obstacle", R"(
A solid that a surface stays outside of: an implicit function, negative inside, in mesh coordinates.

An open MeshSdf is a sheet, which nothing passes from either side.)")
      .def(py::init([](const FunctionArgument& function, double margin,
                       const std::optional<ArrayArgument>& placement) {
             require_not_negative("margin", margin);
             Obstacle obstacle{as_function(function, "function"), margin};
             if (placement) obstacle.placement = as_matrix4(*placement, "placement");
             return obstacle;
           }),
           "function"_a, "margin"_a = 0.0, py::kw_only(), "placement"_a = py::none(),
           "`margin`: the distance that is kept, in mesh units. `placement` (4, 4) turns, moves and scales "
           "the "
           "function's space. Nothing passes an obstacle whose placement moves from step to step.")
      .def_property_readonly(
          "function",
          [](const Obstacle& self) {
            return std::const_pointer_cast<ImplicitFunction>(self.function);  // Python changes none
          },
          "The ImplicitFunction.")
      .def_readonly("margin", &Obstacle::margin, "The distance that is kept.")
      .def_readonly("placement", &Obstacle::placement, "(4, 4) from the function's to mesh coordinates.");
  py::class_<Contact>(module, "Contact", R"(
What a surface does not pass: obstacles, a ground at a height along `up`, and itself.

For deform, stylize and LiveDeformer. Handles whose targets lie beyond give way: report.contact says which.)")
      .def(
          py::init([](const ObstaclesArgument& obstacles, std::optional<double> ground,
                      const std::optional<ArrayArgument>& up, bool itself, double friction) {
            Contact contact{as_items<Obstacle>(obstacles, "obstacles", "Obstacles are needed"), ground};
            contact.itself = itself;
            contact.friction = friction;
            if (up) contact.up = as_vec3(*up, "up");
            require_contact(contact);
            return contact;
          }),
          "obstacles"_a = py::tuple(), py::kw_only(), "ground"_a = py::none(), "up"_a = py::none(),
          "itself"_a = false, "friction"_a = Contact().friction,
          "`up` (3,) is z unless given. `itself`: parts do not pass each other, but for what touches or "
          "overlaps at rest. `friction`: Coulomb's coefficient at obstacles and the ground, in step() alone.")
      .def_property_readonly(
          "obstacles", [](const Contact& self) { return self.obstacles; }, "The Obstacles.")
      .def_readonly("up", &Contact::up, "(3,) the direction in which the ground's height counts.")
      .def_readonly("friction", &Contact::friction, "Coulomb's coefficient at obstacles and the ground.")
      .def_readonly("itself", &Contact::itself, "Whether parts of the shape do not pass each other.")
      .def_readonly("ground", &Contact::ground, "The ground's height, or None.");
}

namespace {

py::object solve_report(const SolveReport& report, double scale) {
  const std::size_t count = report.handle_mean.size();
  double mean = 0.0, max = 0.0;
  py::list handles, loss;
  for (std::size_t i = 0; i < count; ++i) {
    mean += report.handle_mean[i] / static_cast<double>(count);
    max = std::max(max, report.handle_max[i]);
    handles.append(make_report("HandleError", "error_mean"_a = report.handle_mean[i],
                               "error_max"_a = report.handle_max[i]));
  }
  for (const auto& [iteration, value] : report.loop.history) loss.append(py::make_tuple(iteration, value));
  return make_report("SolveReport", "energy"_a = report.arap.energy, "handle_error_mean"_a = mean,
                     "handle_error_max"_a = max, "handles"_a = py::tuple(handles),
                     "max_stretch"_a = report.distortion.max_stretch,
                     "min_stretch"_a = report.distortion.min_stretch, "iterations"_a = report.loop.iterations,
                     "seconds"_a = report.loop.seconds, "stopped_by"_a = name_of(report.loop.stopped_by),
                     "scale"_a = scale, "loss"_a = py::tuple(loss),
                     "notes"_a = py::tuple(py::cast(report.warnings)), "preference"_a = report.preference,
                     "far_target"_a = report.far_target, "turned_triangles"_a = report.turned_triangles,
                     "contact"_a = contact_report(report.contact), "terms"_a = terms_of(report.terms),
                     **field_measures(report.arap, report.distortion));
}

py::object solved(const Solution& solution) {
  py::object field = py::cast(solution.field);
  attach_report(field, solve_report(solution.report, solution.field->frame().scale));
  return field;
}

/// Runs a solver without the GIL; a divergence reaches Python with the last good field.
template <class Solve>
FieldResult solve(Task* task, Solve&& call) {
  try {
    return solved(run_long(task, call));
  } catch (const SolveDiverged& error) {
    raise_diverged(error, solved(error.last_good));
  }
}

FieldResult deform_samples(const SurfaceSamples& samples, const HandlesArgument& handles,
                           DeformOptions options, const EnergiesArgument& energies,
                           const std::optional<CallbackArgument>& callback,
                           const std::optional<Contact>& contact, Task* task) {
  const auto held = as_handles(handles);
  const SolveHooks hooks{as_energies(energies, samples.frame), as_observer(callback.value_or(py::none())),
                         contact};
  return solve(task, [&](const Progress& p) { return deform(samples, held, options, p, hooks); });
}

FieldResult stylize_samples(const SurfaceSamples& samples, const NormalsArgument& normals,
                            StylizeOptions options, const HandlesArgument& handles,
                            const std::optional<ArrayArgument>& weights,
                            const std::optional<ArrayArgument>& orientation,
                            const std::optional<ArrayArgument>& up, const EnergiesArgument& energies,
                            const std::optional<CallbackArgument>& callback,
                            const std::optional<Contact>& contact, Task* task) {
  const Style style = turned_style(normals, orientation);
  const Vector blend = as_vector(weights, "weights");
  const Vec3 upwards = up ? as_vec3(*up, "up") : Vec3(Vec3::UnitZ());
  const auto held = as_handles(handles);
  const SolveHooks hooks{as_energies(energies, samples.frame), as_observer(callback.value_or(py::none())),
                         contact};
  return solve(task, [&](const Progress& p) {
    return stylize(samples, style, options, p, blend, held, upwards, hooks);
  });
}

InverseResult inverse_of(const DeformationField& field, const SurfaceSamples& samples,
                         InverseTrainingOptions options, Task* task) {
  const auto reported = [](const Solution& solution) {
    py::object result = py::cast(solution.field);
    const SolveReport& r = solution.report;
    attach_report(result, make_report("InverseReport", "error_mean"_a = r.handle_mean[0],
                                      "error_max"_a = r.handle_max[0], "iterations"_a = r.loop.iterations,
                                      "seconds"_a = r.loop.seconds));
    return result;
  };
  try {
    return reported(
        run_long(task, [&](const Progress& p) { return train_inverse(field, samples, options, p); }));
  } catch (const SolveDiverged& error) {
    raise_diverged(error, reported(error.last_good));
  }
}

FieldMeasures measures(const DeformationField& field, const ArrayArgument& points) {
  const Points mesh = as_points(points, "points");
  return run_long([&] { return measure_at(field, mesh); });
}

std::pair<double, double> energy_of(const DeformationField& field, const ArrayArgument& points) {
  const ArapValue value = measures(field, points).arap;
  return {value.stretch, value.bend};
}

}  // namespace

void bind_solve(py::module_& module) {
  module.def("deform", &deform_samples, "samples"_a, "handles"_a,
             py::arg_v("options", DeformOptions(), "DeformOptions()"), py::kw_only(),
             "energies"_a = py::tuple(), "callback"_a = py::none(), "contact"_a = py::none(),
             "task"_a = py::none(), R"(
The DeformationField that moves the handles to their targets and is as rigid as possible elsewhere.

It minimises mean stretch + bending · mean bend + handle_weight · mean squared handle distance, over the
samples and the `handles` (CuboidHandle, PointHandle, RegionHandle). Source: section 4 of Djuren et al. 2026,
"As-Rigid-As-Possible Regularization for Implicit Surfaces". The stretch is the paper's; the authors' package
divides it by 3.

`energies` are functions of Jets that return an EnergyValue; each joins the loss with weight 1. `callback` is
called with an Iteration after each iteration, whose terms are those of stretch, bend, barrier, locality,
handles, invertibility and energies[i] that are in use. StopIteration in it ends the solve with the field reached so
far; any other exception propagates.

field.report is a SolveReport. Raises InvalidInput, Cancelled and Diverged, whose attribute `last_good` is the
last field with finite numbers.)");
  module.def("stylize", &stylize_samples, "samples"_a, "normals"_a,
             py::arg_v("options", StylizeOptions(), "StylizeOptions()"), py::kw_only(),
             "handles"_a = py::tuple(), "weights"_a = py::none(), "orientation"_a = py::none(),
             "up"_a = py::none(), "energies"_a = py::tuple(), "callback"_a = py::none(),
             "contact"_a = py::none(), "task"_a = py::none(), R"(
The DeformationField that turns the surface's normals to preferred ones, as rigidly as possible.

`normals` is an array (k, 3), the name of a preset style, or an ObjectStyle; `orientation` (3, 3) rotates it.
`weights` (n,) scale the effect at each sample. Source: Kohlbrenner et al. 2021, "Gauss Stylization".

Without handles the figure keeps its stance (options.keep_stance), its lowest sample along `up` (3,) keeps its
height, and its middle its place across it. `up` is z unless given. Strength 0 is the identity, and a part of
it goes that part of the way; with handles, contact, energies or a network it is the style's weight.
`energies` and `callback` are those of deform; the callback's terms add style and stance. field.report is a
SolveReport, with the mean preference.
Raises as deform does.)");
  module.def("train_inverse", &inverse_of, "field"_a, "samples"_a,
             py::arg_v("options", InverseTrainingOptions(), "InverseTrainingOptions()"), py::kw_only(),
             "task"_a = py::none(), R"(
A network that approximates the inverse of a field, as a DeformationField.

It is trained so that the field maps its values back (the paper's cycle loss), at deformed samples and in
their bounding box, and on the samples' own pairs. report is an InverseReport. For exact inverses of single
points use field.inverse. Raises InvalidInput, Cancelled and Diverged, whose `last_good` is the last network
with finite numbers.)");
  module.def("backend", &backend_name,
             "What does dense products: the ARAPFIELDS_BACKEND that the library was built with.");
  module.def("device_report", &device_report,
             "A sentence that says whether device='cuda' is available, and if not, why.");
  module.def("arap_energy", &energy_of, "field"_a, "points"_a, R"(
Mean (stretch, bend) over points (p, 3) of the rest surface, in the field's unit cube.

The stretch is ‖J − R‖² with R the rotation closest to J; the bend is the squared speed at which R turns.)");
  module.def(
      "distortion",
      [](const DeformationField& field, const ArrayArgument& points) {
        return measures(field, points).distortion;
      },
      "field"_a, "points"_a, R"(
The Distortion at points (p, 3) of the rest surface, such as the vertices of extract_surface.

It holds the smallest det J, the share of points where det J ≤ 0 (the field folds there), and the largest and
the smallest stretch.)");
}

void bind_solve_testing(py::module_& module) {
  py::module_ testing = testing_module(module);
  testing.def("thickness", &probe_thickness, "samples"_a);
  testing.def(
      "bending", [](const SurfaceSamples& s, const DeformOptions& o) { return probe_bending(s, o.surface); },
      "samples"_a, "options"_a);
  testing.def(
      "radial_rows",
      [](const RadialField& field, const Points& cube_points, int count) {
        require(count == 1 || count == 4 || count == 10, "columns", std::to_string(count),
                "1, 4 or 10 are needed");
        return probe_radial_rows(field, cube_points, static_cast<JetOrder>(count));
      },
      "field"_a, "cube_points"_a, "columns"_a,
      "Jets of the field's own basis functions: (columns·n, size), column by column.");
  py::class_<LossProbe>(testing, "LossProbe")
      .def(py::init([](const SurfaceSamples& samples, const std::vector<Handle>& handles, int width,
                       double bending, const Points& preferred, double gauss, double barrier, double margin,
                       double keep_stance, const py::object& energies, const std::string& device) {
             return std::make_unique<LossProbe>(samples, handles, width, bending, preferred, gauss, barrier,
                                                margin, keep_stance, as_energies(energies, samples.frame),
                                                device);
           }),
           "samples"_a, "handles"_a, "width"_a = 8, "bending"_a = 0.0, "preferred"_a = Points(),
           "gauss"_a = 0.0, "barrier"_a = 0.0, "margin"_a = 0.0, "keep_stance"_a = 0.0,
           "energies"_a = py::tuple(), "device"_a = "cpu")
      .def(
          "__call__",
          [](LossProbe& self, const Vector& parameters, std::uint64_t seed) {
            const LossGradient result = self(parameters, seed);
            return py::make_tuple(result.loss, result.gradient);
          },
          "parameters"_a, "seed"_a = 0)
      .def_property_readonly("size", method(&LossProbe::size));
  py::class_<DevicePathScope, std::unique_ptr<DevicePathScope>>(
      testing, "DevicePath", "While it lives, tensors are worked on as on a device instead of by kernels.")
      .def(py::init<>());
  py::class_<EnergyTrial>(testing, "EnergyTrial", "The energy and its parameter gradient, for timing.")
      .def(py::init<const SurfaceSamples&, Index, double>(), "samples"_a, "batch"_a, "bending"_a)
      .def("run", method(&EnergyTrial::run), py::call_guard<py::gil_scoped_release>());
}

}  // namespace arapfields::python
