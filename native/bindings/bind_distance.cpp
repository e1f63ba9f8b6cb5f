// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
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
        const Points v = as_points(vertices, "vertices"), p = as_points(points, "points");
        const Triangles f = as_triangles(triangles, "triangles");
        return run_long(
            task, [&](const Progress& progress) { return signed_distance(v, f, p, threads, progress); });
      },
      "vertices"_a, "triangles"_a, "points"_a, py::kw_only(), "threads"_a = 0, "task"_a = py::none(),
      "Exact distances (p,) of points (p,3) to a triangle soup, negative inside.\n\n"
      "vertices (n,3), triangles (m,3), counter-clockwise seen from outside; open, self-intersecting and\n"
      "degenerate triangles are welcome. Inside is where the generalized winding number exceeds 1/2\n"
      "(Jacobson et al. 2013), evaluated by multipoles (Barill et al. 2018). Same unit as the vertices.\n"
      "threads 0 uses all; the result does not depend on it. InvalidInput for a broken mesh or points that\n"
      "are not finite; Cancelled if the task is.");

  module.def(
      "winding_number",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, const ArrayArgument& points,
         int threads, Task* task) {
        const Points v = as_points(vertices, "vertices"), p = as_points(points, "points");
        const Triangles f = as_triangles(triangles, "triangles");
        return run_long(task, [&](const Progress& progress) {
          const ThreadScope scope(threads);
          Vector numbers(p.rows());
          SignedDistance(v, f, progress).winding_number(p, numbers, progress);
          return numbers;
        });
      },
      "vertices"_a, "triangles"_a, "points"_a, py::kw_only(), "threads"_a = 0, "task"_a = py::none(),
      "Generalized winding numbers (p,) of a triangle soup about points (p,3).\n\n"
      "1 inside and 0 outside a closed surface, fractions near the gaps of an open one, sums where parts\n"
      "overlap. Same arguments and errors as signed_distance.");
}

void bind_mesh_sdf(py::module_& module) {
  py::class_<MeshSdf, ImplicitFunction, std::shared_ptr<MeshSdf>>(
      module, "MeshSdf",
      "The exact signed distance of a triangle soup, wherever a fit can be used, without one.\n\n"
      "Negative inside, where the generalized winding number exceeds 1/2; in the mesh's coordinates and "
      "unit.\n"
      "Extraction and sampling see the triangles that lie between inside and outside: not those hidden in\n"
      "other parts, and, of an open soup, nothing across its holes (narrower than a grid cell, they close).\n"
      "There is no file of it: save the mesh, or a fit.")
      .def(py::init([](const ArrayArgument& vertices, const ArrayArgument& triangles, Task* task) {
             const Points v = as_points(vertices, "vertices");
             const Triangles f = as_triangles(triangles, "triangles");
             return run_long(
                 task, [&](const Progress& progress) { return std::make_shared<MeshSdf>(v, f, progress); });
           }),
           "vertices"_a, "triangles"_a, py::kw_only(), "task"_a = py::none(),
           "vertices (n, 3), triangles (m, 3), counter-clockwise seen from outside; open, self-intersecting "
           "and\n"
           "degenerate triangles are welcome. InvalidInput for a broken mesh.")
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
          "points"_a,
          "Derivatives (p, 3) of the distance by the point: of unit length, pointing outwards; on a triangle "
          "its\n"
          "normal.")
      .def_property_readonly("frame", &MeshSdf::frame,
                             "Mesh coordinates and the unit cube, as of fit_sdf and sample_mesh.")
      .def_property_readonly("closed", &MeshSdf::continuous, "Whether the triangles close up everywhere.")
      .def(
          "save",
          [](const MeshSdf&, const PathArgument&) {
            throw InvalidInput("save", "an exact distance, which is its mesh",
                               "save the mesh instead, or a fit of it (fit_sdf)");
          },
          "path"_a, "InvalidInput: there is no file of an exact distance.")
      .def("__repr__",
           [](const MeshSdf& sdf) { return sdf.continuous() ? "MeshSdf(closed)" : "MeshSdf(open)"; });
}

}  // namespace arapfields::python
