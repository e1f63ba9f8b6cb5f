// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "core/device.h"
#include "energies/styles.h"
#include "solve/deform.h"
#include "solve/field_measures.h"
#include "solve/inverse_training.h"
#include "solve/stylize.h"

namespace arapfields::python {
namespace {

py::dict report_dict(const SolveReport& report, double scale) {
  const auto mean_of = [](const std::vector<double>& values) {
    double sum = 0.0;
    for (const double value : values) sum += value;
    return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
  };
  const auto max_of = [](const std::vector<double>& values) {
    return values.empty() ? 0.0 : *std::max_element(values.begin(), values.end());
  };
  py::dict result(
      "stretch"_a = report.arap.stretch, "bend"_a = report.arap.bend, "energy"_a = report.arap.energy,
      "handle_error_mean"_a = mean_of(report.handle_mean), "handle_error_max"_a = max_of(report.handle_max),
      "handles"_a = py::list(), "min_determinant"_a = report.distortion.min_determinant,
      "flipped_share"_a = report.distortion.flipped_share, "max_stretch"_a = report.distortion.max_stretch,
      "min_stretch"_a = report.distortion.min_stretch, "iterations"_a = report.loop.iterations,
      "seconds"_a = report.loop.seconds, "out_of_time"_a = report.loop.stopped_by == StopReason::time_budget,
      "scale"_a = scale, "loss"_a = py::list(), "notes"_a = report.notes);
  for (const auto& [iteration, loss] : report.loop.history)
    py::list(result["loss"]).append(py::cast(std::vector<double>{static_cast<double>(iteration), loss}));
  for (std::size_t i = 0; i < report.handle_mean.size(); ++i)
    py::list(result["handles"])
        .append(py::dict("error_mean"_a = report.handle_mean[i], "error_max"_a = report.handle_max[i]));
  if (report.preference) result["preference"] = *report.preference;
  if (report.far_target) result["far_target"] = *report.far_target;
  return result;
}

py::object wrap(const Solution& solution) {
  py::object field = py::cast(solution.field);
  field.attr("_report") = report_dict(solution.report, solution.field->frame().scale);
  return field;
}

/// Runs a solver without the GIL; a divergence reaches Python with the last good field.
template <class Solve>
py::object solve(Task* task, Solve&& call) {
  try {
    return wrap(run_long(task, call));
  } catch (const SolveDiverged& error) {
    raise_diverged(error, wrap(error.last_good));
  }
}

Points preferred_from(const py::object& style, const py::object& orientation) {
  const Points normals = py::isinstance<py::str>(style) ? preferred_normals(py::cast<std::string>(style))
                                                        : as_points(style, "normals");
  if (orientation.is_none()) return normals;
  const Eigen::MatrixXd turn = as_matrix(orientation, "orientation");
  require(turn.rows() == 3 && turn.cols() == 3 && turn.allFinite() &&
              (turn.transpose() * turn - Mat3::Identity()).norm() < 1e-4,
          "orientation", "not an orthogonal 3×3 matrix", "a rotation is needed");
  return normals * turn.transpose();
}

/// What the field does at points of mesh coordinates.
FieldMeasures measures(const DeformationField& field, const py::object& points) {
  const Points where = as_points(points, "points");
  return run_long(nullptr, [&](const Progress&) { return measure_at(field, where); });
}

py::tuple energy_of(const DeformationField& field, const py::object& points) {
  const ArapValue value = measures(field, points).arap;
  return py::make_tuple(value.stretch, value.bend);
}

}  // namespace

void bind_solve(py::module_& module) {
  module.def(
      "deform",
      [](const SurfaceSamples& samples, const std::vector<Handle>& handles, const DeformOptions& options,
         Task* task) {
        return solve(task, [&](const Progress& p) { return deform(samples, handles, options, p); });
      },
      "samples"_a, "handles"_a, py::arg_v("options", DeformOptions(), "DeformOptions()"), "task"_a = nullptr,
      "The DeformationField that moves the surface's handles (Cuboid, Point, Region) to their targets and is "
      "as\n"
      "rigid as possible on the samples elsewhere: it minimises mean stretch + bending · mean bend +\n"
      "handle_weight · mean squared handle distance (section 4 of As-Rigid-As-Possible Regularization for\n"
      "Implicit Surfaces, with the stretch as printed there; the authors' package divides it by 3).\n"
      "field.report holds energies, handle errors, the smallest det J, times and the loss history.\n"
      "Raises InvalidInput, Cancelled, and Diverged, whose attribute `last_good` is the field before that.");
  module.def(
      "stylize",
      [](const SurfaceSamples& samples, const py::object& normals, const StylizeOptions& options, Task* task,
         const py::object& weights, const std::vector<Handle>& handles, const py::object& orientation,
         const py::object& up) {
        const Points preferred = preferred_from(normals, orientation);
        const Vector blend = weights.is_none() ? Vector() : as_vector(weights, "weights");
        const Vec3 upwards = up.is_none() ? Vec3(Vec3::UnitZ()) : as_vec3(up, "up");
        return solve(task, [&](const Progress& p) {
          return stylize(samples, preferred, options, p, blend, handles, upwards);
        });
      },
      "samples"_a, "normals"_a, py::arg_v("options", StylizeOptions(), "StylizeOptions()"),
      "task"_a = nullptr, "weights"_a = py::none(), "handles"_a = std::vector<Handle>(),
      "orientation"_a = py::none(), "up"_a = py::none(),
      "The DeformationField that turns the surface's normals to preferred ones: `normals` (k, 3) or a "
      "style's\n"
      "name, turned by `orientation` (3, 3). `weights` (n,) blend the effect sample by sample. Without "
      "handles\n"
      "the figure keeps its stance (options.keep_stance) and the lowest sample stays in place, seen along "
      "`up`\n"
      "(3,), else z; strength 0 is the identity. field.report['preference'] is the mean\n"
      "preference reached. Raises as deform does.");
  module.def(
      "train_inverse",
      [](const DeformationField& field, const SurfaceSamples& samples, const InverseTrainingOptions& options,
         Task* task) {
        const Solution solution =
            run_long(task, [&](const Progress& p) { return train_inverse(field, samples, options, p); });
        py::object result = py::cast(solution.field);
        const SolveReport& r = solution.report;
        result.attr("_report") = py::dict("error_mean"_a = r.handle_mean[0], "error_max"_a = r.handle_max[0],
                                          "iterations"_a = r.loop.iterations, "seconds"_a = r.loop.seconds);
        return result;
      },
      "field"_a, "samples"_a, py::arg_v("options", InverseTrainingOptions(), "InverseTrainingOptions()"),
      "task"_a = nullptr,
      "A network that approximates field's inverse, as a DeformationField: trained so that the field takes\n"
      "its values back, at deformed samples and in their box (the paper's cycle loss), and on the samples'\n"
      "own pairs. report: error_mean and error_max over the samples, in mesh units. For exact inverses of\n"
      "single points use field.inverse.");
  module.def("device_report", &device_report,
             "In words: whether device='cuda' can be asked for, and if not, why.");
  module.def("arap_energy", &energy_of, "field"_a, "points"_a,
             "(stretch, bend), means over the points (p, 3) of the rest surface, in the field's unit cube:\n"
             "stretch ‖J − R‖² with R the rotation closest to J, bend the squared speed at which R turns.");
  module.def(
      "distortion",
      [](const DeformationField& field, const py::object& points) {
        return measures(field, points).distortion;
      },
      "field"_a, "points"_a,
      "The Distortion at points (p, 3) of the rest surface, for instance the vertices of extract_surface:\n"
      "the smallest det J, the share of points where it is not positive (the field folds there), and the\n"
      "largest and smallest stretch.");
}

}  // namespace arapfields::python
