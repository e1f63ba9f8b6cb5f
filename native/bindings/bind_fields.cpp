// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/files.h"
#include "bindings/jet_arrays.h"
#include "bindings/reports.h"
#include "fields/apply_field.h"
#include "fields/inverse.h"
#include "fields/invertible_field.h"
#include "io/files.h"

namespace arapfields::python {
namespace {

using FieldArray = py::array_t<double>;

/// Jets at points of mesh coordinates, as one block.
JetBlock<double> evaluate(const DeformationField& field, const ArrayArgument& points, JetOrder order,
                          Index& count) {
  const Points mesh = as_finite_points(points, "points");
  count = mesh.rows();
  JetBlock<double> block(count, order);
  run_long([&] { field.evaluate(field.frame().to_cube(mesh), block.view()); });
  return block;
}

std::optional<Triangles> as_triangles_of(const std::optional<ArrayArgument>& triangles) {
  return triangles ? std::optional<Triangles>(as_triangles(*triangles, "triangles")) : std::nullopt;
}

Points values(const DeformationField& field, const ArrayArgument& points,
              const std::optional<ArrayArgument>& triangles) {
  TriangleMesh mesh{as_finite_points(points, "points"), {}};
  const std::optional<Triangles> faces = as_triangles_of(triangles);
  if (faces) mesh.triangles = *faces;
  return run_long([&] {
    if (!faces) return field.at(mesh.vertices);
    validate(mesh);
    return field.at_vertices(mesh);
  });
}

FieldArray jacobian(const DeformationField& field, const ArrayArgument& points) {
  Index count = 0;
  JetBlock<double> block = evaluate(field, points, JetOrder::first, count);
  FieldArray result({count, Index{3}, Index{3}});
  auto entry = result.mutable_unchecked<3>();
  for (Index p = 0; p < count; ++p)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) entry(p, i, j) = block.view().at(first_column(j), p)[i];
  return result;
}

FieldArray hessian(const DeformationField& field, const ArrayArgument& points) {
  Index count = 0;
  JetBlock<double> block = evaluate(field, points, JetOrder::second, count);
  FieldArray result({count, Index{3}, Index{3}, Index{3}});
  auto entry = result.mutable_unchecked<4>();
  for (Index p = 0; p < count; ++p)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k)
          entry(p, i, j, k) = block.view().at(second_column(j, k), p)[i] / field.frame().scale;
  return result;
}

Points inverse(const DeformationField& field, const ArrayArgument& points, double tolerance, Task* task) {
  const Points mesh = as_points(points, "points");
  NewtonInverseOptions options;
  options.tolerance = tolerance;
  return run_long(task, [&](const Progress& progress) {
    return field.frame().to_mesh(invert(field, field.frame().to_cube(mesh), options, progress).points);
  });
}

void save_field(const py::object& self, const PathArgument& path) {
  const auto& field = py::cast<const DeformationField&>(self);
  const std::string place = as_path(path), measured = report_text(report_or_none(self));
  const py::gil_scoped_release release;
  save_field(place, field, measured);
}

FieldResult loaded_field(const PathArgument& path) {
  const std::string place = as_path(path);
  std::string measured;
  py::object field = py::cast(run_long([&] { return load_field(place, &measured); }));
  attach_report(field, report_from(measured, place));
  return field;
}

}  // namespace

void bind_fields(py::module_& module) {
  py::class_<DeformationField, std::shared_ptr<DeformationField>>(
      module, "DeformationField", py::dynamic_attr(),
      "A smooth deformation of space, x ↦ f(x), with its derivatives; all in mesh coordinates.")
      .def("__call__", &values, "points"_a, py::kw_only(), "triangles"_a = py::none(), R"(
Deformed positions (p, 3) of points (p, 3).

With `triangles` (m, 3) the points are a mesh's vertices: where its parts touch at rest, as closed lips do, each
vertex moves with the part that it belongs to. Else a point takes the side of the surface that is nearest.)")
      .def(
          "apply",
          [](const DeformationField& field, const ArrayArgument& points, double strength,
             const std::optional<ArrayArgument>& triangles) {
            const Points mesh = as_points(points, "points");
            const std::optional<Triangles> faces = as_triangles_of(triangles);
            return run_long([&] { return apply_field(field, mesh, strength, faces ? &*faces : nullptr); });
          },
          "points"_a, py::kw_only(), "strength"_a = 1.0, "triangles"_a = py::none(),
          R"(
The field at another mesh of the same shape, of any resolution or topology: (p, 3).

`strength` scales the displacement. With `triangles` (m, 3) the points are a mesh's vertices: where its parts
touch at rest, as closed lips or neighbouring fingers do, each vertex moves with the part that it belongs to.
Without them, and in calls of the field itself, a point takes the side of the nearest point of the surface that
the field was solved on. InvalidInput where more than a tenth of the points lie outside the body's
box and farther from its surface than 0.1 of its size.)")
      .def("jacobian", &jacobian, "points"_a, "(p, 3, 3): [:, i, j] = ∂f_i/∂x_j.")
      .def("hessian", &hessian, "points"_a, "(p, 3, 3, 3): [:, i, j, k] = ∂²f_i/∂x_j∂x_k (1/length).")
      .def("inverse", &inverse, "points"_a, py::kw_only(), "tolerance"_a = NewtonInverseOptions().tolerance,
           "task"_a = py::none(),
           R"(
Points (p, 3) that the field maps to `points`, by Newton's method with the analytic Jacobian.

Rows are NaN where no preimage is found within `tolerance`, a share of frame.scale (half the side of the
field's cube). Where the field folds space there are several; the one nearest to the surface's rest samples is
preferred.)")
      .def_property_readonly(
          "frame", [](const DeformationField& self) { return self.frame(); },
          "The Frame of the unit cube in which the field is defined.")
      .def_property_readonly(
          "report", [](const py::object& self) { return FieldReportResult(report_of(self)); },
          R"(
The SolveReport of deform and stylize, the LiveReport, WrapReport or InverseReport.

AttributeError for a field without one.)")
      // DeformationField[SolveReport] in annotations that are evaluated; see the stub.
      .def_static("__class_getitem__", [](const py::object&) { return py::type::of<DeformationField>(); })
      .def("save", &save_field, "path"_a,
           R"(
Writes field and report as one file, in whole or not at all.

OSError where the system refuses, InvalidInput for a path that is not a regular file.)")
      .def_static("load", &loaded_field, "path"_a,
                  R"(
The field of a file that save() wrote, with its report.

OSError for a file that cannot be read. InvalidInput, naming the file, for one that is damaged, foreign, of
another kind or version, or holds unusable numbers.)");
}

void bind_invertible_testing(py::module_& module) {
  testing_module(module).def(
      "invertible_field",
      [](int width, int layers, int octaves, int couplings, const Vector& parameters, const Points& points,
         int columns, const Vector& cotangents) {
        CouplingShape shape;
        shape.width = width, shape.layers = layers, shape.octaves = octaves, shape.couplings = couplings;
        const InvertibleProbe probe =
            probe_invertible(shape, parameters, points, static_cast<JetOrder>(columns), cotangents);
        return py::make_tuple(probe.jets, probe.gradient, probe.preimages);
      },
      "width"_a, "layers"_a, "octaves"_a, "couplings"_a, "parameters"_a, "points"_a, "columns"_a,
      "cotangents"_a);
}

}  // namespace arapfields::python
