// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/handles.h"
#include "bindings/jet_arrays.h"
#include "bindings/python_function.h"
#include "bindings/reports.h"
#include "bindings/styles.h"
#include "core/aten_path.h"
#include "core/device.h"
#include "options/deform.h"
#include "solve/deform.h"
#include "solve/field_measures.h"
#include "solve/stylize.h"
#include "solve/trained/inverse_training.h"
#include "solve/trained/loss_probe.h"

namespace arapfields::python {
namespace {

py::object solve_report(const SolveReport& report, double scale) {
  double mean = 0.0, max = 0.0;
  py::list handles, loss;
  const py::object handle_error = py::module_::import("arapfields.reports").attr("HandleError");
  for (std::size_t i = 0; i < report.handle_mean.size(); ++i) {
    mean += report.handle_mean[i] / static_cast<double>(report.handle_mean.size());
    max = std::max(max, report.handle_max[i]);
    handles.append(
        handle_error("error_mean"_a = report.handle_mean[i], "error_max"_a = report.handle_max[i]));
  }
  for (const auto& [iteration, value] : report.loop.history) loss.append(py::make_tuple(iteration, value));
  return make_report(
      "SolveReport",
      py::dict("stretch"_a = report.arap.stretch, "bend"_a = report.arap.bend,
               "energy"_a = report.arap.energy, "handle_error_mean"_a = mean, "handle_error_max"_a = max,
               "handles"_a = py::tuple(handles), "min_determinant"_a = report.distortion.min_determinant,
               "flipped_share"_a = report.distortion.flipped_share,
               "max_stretch"_a = report.distortion.max_stretch,
               "min_stretch"_a = report.distortion.min_stretch, "iterations"_a = report.loop.iterations,
               "seconds"_a = report.loop.seconds, "stopped_by"_a = name_of(report.loop.stopped_by),
               "scale"_a = scale, "loss"_a = py::tuple(loss),
               "notes"_a = py::tuple(py::cast(report.warnings)), "preference"_a = report.preference,
               "far_target"_a = report.far_target));
}

py::object wrap(const Solution& solution) {
  py::object field = py::cast(solution.field);
  attach_report(field, solve_report(solution.report, solution.field->frame().scale));
  return field;
}

/// Runs a solver without the GIL; a divergence reaches Python with the last good field.
template <class Solve>
FieldResult solve(Task* task, Solve&& call) {
  try {
    return wrap(run_long(task, call));
  } catch (const SolveDiverged& error) {
    raise_diverged(error, wrap(error.last_good));
  }
}

FieldResult deform_samples(const SurfaceSamples& samples, const HandlesArgument& handles,
                           const DeformOptions& options, const EnergiesArgument& energies,
                           const std::optional<CallbackArgument>& callback, Task* task) {
  const auto held = as_handles(handles);
  const SolveHooks hooks{as_energies(energies, samples.frame), as_observer(callback.value_or(py::none()))};
  return solve(task, [&](const Progress& p) { return deform(samples, held, options, p, hooks); });
}

Style turned_style(const NormalsArgument& normals, const std::optional<ArrayArgument>& orientation) {
  Style style = as_style(normals);
  if (!orientation) return style;
  const Mat3 turn = as_rotation(*orientation, "orientation");
  if (style.object) return style.object->turned(turn);
  return Points(style.preferred * turn.transpose());
}

FieldResult stylize_samples(const SurfaceSamples& samples, const NormalsArgument& normals,
                            const StylizeOptions& options, const HandlesArgument& handles,
                            const std::optional<ArrayArgument>& weights,
                            const std::optional<ArrayArgument>& orientation,
                            const std::optional<ArrayArgument>& up, const EnergiesArgument& energies,
                            const std::optional<CallbackArgument>& callback, Task* task) {
  const Style style = turned_style(normals, orientation);
  const Vector blend = weights ? as_vector(*weights, "weights") : Vector();
  const Vec3 upwards = up ? as_vec3(*up, "up") : Vec3(Vec3::UnitZ());
  const auto held = as_handles(handles);
  const SolveHooks hooks{as_energies(energies, samples.frame), as_observer(callback.value_or(py::none()))};
  return solve(task, [&](const Progress& p) {
    return stylize(samples, style, options, p, blend, held, upwards, hooks);
  });
}

InverseResult inverse_of(const DeformationField& field, const SurfaceSamples& samples,
                         const InverseTrainingOptions& options, Task* task) {
  const Solution solution =
      run_long(task, [&](const Progress& p) { return train_inverse(field, samples, options, p); });
  py::object result = py::cast(solution.field);
  const SolveReport& r = solution.report;
  attach_report(result,
                make_report("InverseReport",
                            py::dict("error_mean"_a = r.handle_mean[0], "error_max"_a = r.handle_max[0],
                                     "iterations"_a = r.loop.iterations, "seconds"_a = r.loop.seconds)));
  return result;
}

/// What the field does at points of mesh coordinates.
FieldMeasures measures(const DeformationField& field, const ArrayArgument& points) {
  const Points where = as_points(points, "points");
  return run_long(nullptr, [&](const Progress&) { return measure_at(field, where); });
}

std::pair<double, double> energy_of(const DeformationField& field, const ArrayArgument& points) {
  const ArapValue value = measures(field, points).arap;
  return {value.stretch, value.bend};
}

}  // namespace

void bind_solve(py::module_& module) {
  module.def(
      "deform", &deform_samples, "samples"_a, "handles"_a,
      py::arg_v("options", DeformOptions(), "DeformOptions()"), py::kw_only(), "energies"_a = py::tuple(),
      "callback"_a = py::none(), "task"_a = py::none(),
      "The DeformationField that moves the surface's handles (CuboidHandle, PointHandle, RegionHandle) to "
      "their\n"
      "targets and is as rigid as possible on the samples elsewhere: it minimises mean stretch + bending · "
      "mean\n"
      "bend + handle_weight · mean squared handle distance (section 4 of As-Rigid-As-Possible "
      "Regularization\n"
      "for Implicit Surfaces, with the stretch as printed there; the authors' package divides it by 3), and\n"
      "each of `energies`, functions of Jets that return an EnergyValue. `callback` gets each "
      "Iteration\n"
      "(terms: stretch, bend, barrier, handles, invertibility, energies[i], those that there are); raising\n"
      "StopIteration in it ends the solve with what was reached, anything else comes through.\n"
      "field.report is a SolveReport: energies, handle errors, the smallest det J, times, the loss history.\n"
      "Raises InvalidInput, Cancelled, and Diverged, whose attribute `last_good` is the field before that.");
  module.def(
      "stylize", &stylize_samples, "samples"_a, "normals"_a,
      py::arg_v("options", StylizeOptions(), "StylizeOptions()"), py::kw_only(), "handles"_a = py::tuple(),
      "weights"_a = py::none(), "orientation"_a = py::none(), "up"_a = py::none(), "energies"_a = py::tuple(),
      "callback"_a = py::none(), "task"_a = py::none(),
      "The DeformationField that turns the surface's normals to preferred ones: `normals` (k, 3), a style's\n"
      "name, or an ObjectStyle, turned by `orientation` (3, 3). `weights` (n,) blend the effect sample by "
      "sample. Without "
      "handles\n"
      "the figure keeps its stance (options.keep_stance) and the lowest sample stays in place (nearly, "
      "beside\n"
      "`energies`), seen along `up` (3,), else z; strength 0 is the identity. `energies` and `callback` are\n"
      "deform's, with two more terms, style and stance. field.report is a SolveReport with the mean "
      "preference\n"
      "reached. Raises as deform does.");
  module.def(
      "train_inverse", &inverse_of, "field"_a, "samples"_a,
      py::arg_v("options", InverseTrainingOptions(), "InverseTrainingOptions()"), py::kw_only(),
      "task"_a = py::none(),
      "A network that approximates field's inverse, as a DeformationField: trained so that the field takes\n"
      "its values back, at deformed samples and in their box (the paper's cycle loss), and on the samples'\n"
      "own pairs. report: an InverseReport. For exact inverses of single points use field.inverse.");
  module.def("device_report", &device_report,
             "In words: whether device='cuda' can be asked for, and if not, why.");
  module.def("arap_energy", &energy_of, "field"_a, "points"_a,
             "(stretch, bend), means over the points (p, 3) of the rest surface, in the field's unit cube:\n"
             "stretch ‖J − R‖² with R the rotation closest to J, bend the squared speed at which R turns.");
  module.def(
      "distortion",
      [](const DeformationField& field, const ArrayArgument& points) {
        return measures(field, points).distortion;
      },
      "field"_a, "points"_a,
      "The Distortion at points (p, 3) of the rest surface, for instance the vertices of extract_surface:\n"
      "the smallest det J, the share of points where it is not positive (the field folds there), and the\n"
      "largest and smallest stretch.");
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
                       double keep_stance, const py::object& energies) {
             return std::make_unique<LossProbe>(samples, handles, width, bending, preferred, gauss, barrier,
                                                margin, keep_stance, as_energies(energies, samples.frame));
           }),
           "samples"_a, "handles"_a, "width"_a = 8, "bending"_a = 0.0, "preferred"_a = Points(),
           "gauss"_a = 0.0, "barrier"_a = 0.0, "margin"_a = 0.0, "keep_stance"_a = 0.0,
           "energies"_a = py::tuple())
      .def(
          "__call__",
          [](LossProbe& self, const Vector& parameters, std::uint64_t seed) {
            const LossGradient found = self(parameters, seed);
            return py::make_tuple(found.loss, found.gradient);
          },
          "parameters"_a, "seed"_a = 0)
      .def_property_readonly("size", &LossProbe::size);
  py::class_<AtenPathScope, std::unique_ptr<AtenPathScope>>(
      testing, "AtenPath", "While it lives, tensors are worked on as on a device instead of by kernels.")
      .def(py::init<>());
  py::class_<EnergyTrial>(testing, "EnergyTrial", "The energy and its parameter gradient, for timing.")
      .def(py::init<const SurfaceSamples&, Index, double>(), "samples"_a, "batch"_a, "bending"_a)
      .def("run", &EnergyTrial::run, py::call_guard<py::gil_scoped_release>());
}

}  // namespace arapfields::python
