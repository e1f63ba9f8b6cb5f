// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "energies/object_style.h"

namespace arapfields::python {

void bind_object_style(py::module_& module) {
  py::class_<ObjectStyle>(
      module, "ObjectStyle",
      "A style read off a closed mesh: normals turn to what the object has in their direction, its normal\n"
      "where the ray from its centroid leaves it for the last time. A sphere changes nothing. What is bent "
      "by\n"
      "less than 30 degrees from triangle to triangle counts as smooth; across sharper edges the map is\n"
      "smoothed a little.")
      .def(py::init([](const ArrayArgument& vertices, const ArrayArgument& triangles, Task* task) {
             const Points v = as_points(vertices, "vertices");
             const Triangles f = as_triangles(triangles, "triangles");
             return run_long(task, [&](const Progress& progress) { return ObjectStyle(v, f, progress); });
           }),
           "vertices"_a, "triangles"_a, py::kw_only(), "task"_a = py::none(),
           "vertices (n, 3), triangles (m, 3), counter-clockwise seen from outside, or all the other way "
           "round.\n"
           "InvalidInput for a broken mesh, an open one, and one that is flat.")
      .def(
          "normals",
          [](const ObjectStyle& style, const ArrayArgument& directions, double smoothing) {
            Points d = as_points(directions, "directions");
            return run_long(nullptr, [&](const Progress&) { return style.normals(d, smoothing); });
          },
          "directions"_a, py::kw_only(), "smoothing"_a = ObjectStyle::usual_smoothing,
          "What the object asks of directions (n, 3): unit normals (n, 3). `smoothing`, in radians: over "
          "what\n"
          "angle the map is smoothed, 0 to a right angle. Directions in which nothing is left are kept.")
      .def(
          "turned",
          [](const ObjectStyle& style, const ArrayArgument& orientation) {
            return style.turned(as_rotation(orientation, "orientation"));
          },
          "orientation"_a, "The same object after the rotation (3, 3) about its centroid.")
      .def_property_readonly("centroid", &ObjectStyle::centroid,
                             "(3,) of the solid, in the mesh's coordinates.")
      .def("__repr__", [](const ObjectStyle&) { return "ObjectStyle()"; });
}

}  // namespace arapfields::python
