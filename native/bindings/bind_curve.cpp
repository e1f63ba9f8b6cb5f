// SPDX-License-Identifier: GPL-3.0-or-later
// Curves of the plane: the energy's other dimension, from samples to field.
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/pickling.h"
#include "curve/deform_curve.h"
#include "energies/arap2d.h"
#include "sampling/curve_samples.h"

namespace arapfields::python {
namespace {

Points2 as_points2(const py::handle& value, const std::string& argument) {
  const Eigen::MatrixXd matrix = as_matrix(value, argument);
  require(matrix.cols() == 2, argument,
          "shape (" + std::to_string(matrix.rows()) + ", " + std::to_string(matrix.cols()) + ")",
          "expected points of the plane, shape (n, 2)");
  return matrix;
}

py::array_t<double> jacobian(const CurveSolution& self, const ArrayArgument& points) {
  const Points2 at = as_points2(points, "points");
  const RowMatrix<double> jets = self.field.jets(at);
  const Index n = at.rows();
  py::array_t<double> result({n, Index(2), Index(2)});
  auto out = result.mutable_unchecked<3>();
  for (Index p = 0; p < n; ++p)
    for (int i = 0; i < 2; ++i)
      for (int k = 0; k < 2; ++k) out(p, i, k) = jets((1 + k) * n + p, i);
  return result;
}

CurveReport report_of_state(const py::tuple& parts) {
  const PickledState state(parts, "CurveReport", 8);
  return {state.number(0), state.number(1), state.number(2), state.number(3),
          state.number(4), state.index(5),  state.number(6), state.number(7) != 0.0};
}

CurveSolution field_of_state(const py::tuple& parts) {
  const PickledState state(parts, "CurveField", 6);
  CurveSolution solution;
  solution.field.center = state.matrix(0, 2, 1);
  solution.field.scale = state.number(1);
  require_positive(state.name(1), solution.field.scale);
  solution.field.basis.centers = state.matrix(2, -1, 2);
  solution.field.basis.radii = state.matrix(3, solution.field.basis.centers.rows(), 1);
  require((solution.field.basis.radii.array() > 0.0).all(), state.name(3), "some are not positive",
          "all must be");
  solution.field.coefficients = state.matrix(4, solution.field.basis.size(), 2);
  solution.report = state.of<CurveReport>(5, "CurveReport");
  return solution;
}

template <class Scalar>
void bind_testing(py::module_& testing) {
  using Array = py::array_t<Scalar, py::array::c_style>;
  testing.def(
      "arap_energy2",
      [](const Array& jets, double bending, double weight) {
        require(jets.ndim() == 3 && jets.shape(0) == columns2 && jets.shape(2) == 2, "jets",
                std::to_string(jets.ndim()) + " dimensions", "expected shape (6, n, 2)");
        Array cotangents({jets.shape(0), jets.shape(1), jets.shape(2)});
        std::fill_n(cotangents.mutable_data(), cotangents.size(), Scalar(0));
        const ArapValue value = arap_energy2<Scalar>({jets.data(), jets.shape(1)}, bending, weight,
                                                     {cotangents.mutable_data(), jets.shape(1)});
        return py::make_tuple(value.stretch, value.bend, cotangents);
      },
      "jets"_a.noconvert(), "bending"_a, "weight"_a = 1.0);
}

}  // namespace

void bind_curve(py::module_& module) {
  py::class_<CurveSamples>(module, "CurveSamples", "Samples of a plane curve, in order along it.")
      .def_readonly("points", &CurveSamples::points, "(n, 2)")
      .def_readonly("normals", &CurveSamples::normals,
                    "(n, 2) unit normals: outward of a closed curve, right-hand of an open one.")
      .def(py::pickle([](const CurveSamples& self) { return py::make_tuple(self.points, self.normals); },
                      [](const py::tuple& parts) {
                        const PickledState state(parts, "CurveSamples", 2);
                        CurveSamples samples{state.matrix(0, -1, 2), {}};
                        samples.normals = state.matrix(1, samples.points.rows(), 2);
                        return samples;
                      }));
  module.def(
      "sample_curve",
      [](const ArrayArgument& vertices, Index count, bool closed) {
        return sample_curve(as_points2(vertices, "vertices"), count, closed);
      },
      "vertices"_a, "count"_a = 400, py::kw_only(), "closed"_a = true,
      R"(
CurveSamples at equal distances along the polygon with these vertices (m, 2).

closed: the last vertex is joined to the first. InvalidInput for too few or non-finite vertices, a curve
without length, and count < 1.)");

  py::class_<CurveHandle>(module, "CurveHandle",
                          R"(
Samples of a plane curve, by index, that follow a rigid motion.

`motion` (3, 3) acts on homogeneous (x, y, 1). Its default, the identity, holds the samples in place.)")
      .def(py::init([](const ArrayArgument& samples, const std::optional<ArrayArgument>& motion,
                       double weight) {
             CurveHandle handle;
             handle.samples = as_indices(samples, "samples");
             if (motion) {
               const Eigen::MatrixXd matrix = as_matrix(*motion, "motion");
               require(matrix.rows() == 3 && matrix.cols() == 3, "motion",
                       "shape (" + std::to_string(matrix.rows()) + ", " + std::to_string(matrix.cols()) + ")",
                       "expected (3, 3)");
               handle.motion = matrix;
             }
             handle.weight = weight;
             handle.validate();
             return handle;
           }),
           "samples"_a, "motion"_a = py::none(), "weight"_a = 1.0)
      .def_readonly("samples", &CurveHandle::samples)
      .def_readonly("motion", &CurveHandle::motion)
      .def_readonly("weight", &CurveHandle::weight);

  py::class_<CurveReport>(module, "CurveReport", "Energies, handle errors and convergence of deform_curve.")
      .def_readonly("stretch", &CurveReport::stretch, "Mean ‖J − R‖² over the samples.")
      .def_readonly("bend", &CurveReport::bend, "Mean bend over the samples, in the curve's square.")
      .def_readonly("handle_error_mean", &CurveReport::handle_error_mean, "In the curve's units.")
      .def_readonly("handle_error_max", &CurveReport::handle_error_max, "In the curve's units.")
      .def_readonly("min_determinant", &CurveReport::min_determinant, "Smallest det J at the samples.")
      .def_readonly("iterations", &CurveReport::iterations, "Quasi-Newton steps taken.")
      .def_readonly("loss", &CurveReport::loss, "Reached: stretch + bending · bend, handles, smoothness.")
      .def_readonly("converged", &CurveReport::converged, "A further step would gain next to nothing.")
      .def(py::pickle(
          [](const CurveReport& self) {
            return py::make_tuple(self.stretch, self.bend, self.handle_error_mean, self.handle_error_max,
                                  self.min_determinant, self.iterations, self.loss, self.converged ? 1 : 0);
          },
          &report_of_state));

  py::class_<CurveSolution>(module, "CurveField",
                            "A deformation of the plane, made for a curve by deform_curve.")
      .def(
          "__call__",
          [](const CurveSolution& self, const ArrayArgument& points) {
            return self.field(as_points2(points, "points"));
          },
          "points"_a, "(p, 2) → (p, 2), in the curve's coordinates.")
      .def("jacobian", &jacobian, "points"_a, "(p, 2, 2), [p, i, k] = ∂f_i/∂x_k.")
      .def_readonly("report", &CurveSolution::report)
      .def(py::pickle(
          [](const CurveSolution& self) {
            const CurveField& field = self.field;
            return py::make_tuple(Eigen::MatrixXd(field.center), field.scale, field.basis.centers,
                                  Eigen::MatrixXd(field.basis.radii), field.coefficients, self.report);
          },
          &field_of_state));

  module.def(
      "deform_curve",
      [](const ArrayArgument& points, const CurveHandlesArgument& handles, CurveOptions options, Task* task) {
        const Points2 samples = as_points2(points, "points");
        const auto held = as_items<CurveHandle>(handles, "handles", "CurveHandles are needed");
        return run_long(
            task, [&](const Progress& progress) { return deform_curve(samples, held, options, progress); });
      },
      "points"_a, "handles"_a, py::arg_v("options", CurveOptions(), "CurveOptions()"), py::kw_only(),
      "task"_a = py::none(),
      R"(
Deforms a plane curve, given by its samples (n, 2), as rigidly as possible so that handles follow their motions.

The energy is that of surfaces with d = 2; the field is a sum of Gaussian centers. Lengths and weights refer
to the square in which the curve's bounding box has half-extent 0.75. InvalidInput for no handles, indices out
of range, and motions that are not rigid.)");

  py::module_ testing = module.attr("testing");
  bind_testing<double>(testing);
  bind_testing<float>(testing);
}

}  // namespace arapfields::python
