// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "core/parallel.h"
#include "distance/mesh_sdf.h"
#include "distance/signed_distance.h"

namespace arapfields::python {

void bind_distance(py::module_& module) {
  module.def(
      "signed_distance",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, const ArrayArgument& points,
         int threads, Task* task) {
        const TriangleMesh mesh = as_mesh(vertices, triangles);
        const Points p = as_points(points, "points");
        return run_long(task, [&](const Progress& progress) {
          return signed_distance(mesh.vertices, mesh.triangles, p, threads, progress);
        });
      },
      "vertices"_a, "triangles"_a, "points"_a, py::kw_only(), "threads"_a = 0, "task"_a = py::none(), R"(
Exact distances (p,) of points (p, 3) to a triangle soup, negative inside, in the unit of the vertices.

vertices (n, 3), triangles (m, 3), counter-clockwise seen from outside. Open, self-intersecting and degenerate
triangles are allowed. Inside is where the generalized winding number exceeds 1/2 (Jacobson et al. 2013),
evaluated with multipoles (Barill et al. 2018). threads 0 uses all; the result does not depend on it.
InvalidInput for a broken mesh and for points that are not finite; Cancelled if the task is.)");
  module.def(
      "winding_number",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, const ArrayArgument& points,
         int threads, Task* task) {
        const TriangleMesh mesh = as_mesh(vertices, triangles);
        const Points p = as_points(points, "points");
        return run_long(task, [&](const Progress& progress) {
          const ThreadScope scope(threads);
          Vector numbers(p.rows());
          SignedDistance(mesh.vertices, mesh.triangles, progress).winding_number(p, numbers, progress);
          return numbers;
        });
      },
      "vertices"_a, "triangles"_a, "points"_a, py::kw_only(), "threads"_a = 0, "task"_a = py::none(), R"(
Generalized winding numbers (p,) of a triangle soup about points (p, 3).

1 inside and 0 outside a closed surface, fractions near the gaps of an open one, sums where parts overlap.
Same arguments and errors as signed_distance. Source: Jacobson et al. 2013.)");
}

void bind_mesh_sdf(py::module_& module) {
  py::class_<MeshSdf, ImplicitFunction, std::shared_ptr<MeshSdf>>(module, "MeshSdf",
                                                                  R"(
The exact signed distance of a triangle soup as an ImplicitFunction; serves wherever a fit does.

Negative inside, where the generalized winding number exceeds 1/2; in the mesh's coordinates and unit.
Extraction and sampling see the triangles between inside and outside. They do not see triangles hidden in
other parts, nor a surface across the holes of an open soup (holes narrower than a grid cell close). It has no
file format: save the mesh, or a fit.)")
      .def(py::init([](const ArrayArgument& vertices, const ArrayArgument& triangles, Task* task) {
             const TriangleMesh mesh = as_mesh(vertices, triangles);
             return run_long(task, [&](const Progress& progress) {
               return std::make_shared<MeshSdf>(mesh.vertices, mesh.triangles, progress);
             });
           }),
           "vertices"_a, "triangles"_a, py::kw_only(), "task"_a = py::none(),
           R"(
vertices (n, 3), triangles (m, 3), counter-clockwise seen from outside; open, self-intersecting and degenerate
triangles are allowed. InvalidInput for a broken mesh.)")
      .def(
          "__call__",
          [](const MeshSdf& sdf, const ArrayArgument& points) {
            const Points p = as_points(points, "points");
            return run_long(nullptr, [&](const Progress& progress) { return sdf.distances(p, progress); });
          },
          "points"_a, "Distances (p,) at points (p, 3), negative inside.")
      .def(
          "gradient",
          [](const MeshSdf& sdf, const ArrayArgument& points) {
            const Points p = as_points(points, "points");
            return run_long(nullptr, [&](const Progress& progress) { return sdf.gradients(p, progress); });
          },
          "points"_a, "Unit gradients (p, 3) of the distance, pointing outwards; on a triangle, its normal.")
      .def_property_readonly("frame", method(&MeshSdf::frame), "The Frame of the unit cube, as in fit_sdf.")
      .def_property_readonly(
          "vertices", [](const MeshSdf& sdf) { return sdf.vertices(); }, "(n, 3) of the soup.")
      .def_property_readonly(
          "triangles", [](const MeshSdf& sdf) { return sdf.triangles(); }, "(m, 3) of the soup.")
      .def_property_readonly("closed", method(&MeshSdf::continuous), "Whether the soup is closed.")
      .def(
          "save",
          [](const MeshSdf&, const PathArgument&) {
            throw InvalidInput("save", "an exact distance, which is its mesh",
                               "save the mesh instead, or a fit of it (fit_sdf)");
          },
          "path"_a, "InvalidInput: an exact distance has no file format.")
      .def("__repr__",
           [](const MeshSdf& sdf) { return sdf.continuous() ? "MeshSdf(closed)" : "MeshSdf(open)"; });
}

}  // namespace arapfields::python
