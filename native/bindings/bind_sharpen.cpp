// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/solve_arguments.h"
#include "sharpen/folded_triangles.h"
#include "sharpen/sharpen.h"

namespace arapfields::python {

void bind_sharpen(py::module_& module) {
  module.attr("CENTERS_BEFORE_SHARPEN") = centers_before_sharpen;
  module.attr("ITERATIONS_BEFORE_SHARPEN") = iterations_before_sharpen;
  module.def(
      "sharpen",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, const ArrayArgument& moved,
         const NormalsArgument& normals, SharpenOptions options, const std::optional<ArrayArgument>& weights,
         const std::optional<ArrayArgument>& orientation, const std::optional<ArrayArgument>& up,
         const std::optional<Contact>& contact, bool alone, Task* task) {
        const TriangleMesh mesh = as_mesh(vertices, triangles);
        const Points after = as_points(moved, "moved");
        const Style style = turned_style(normals, orientation);
        const std::optional<Vec3> upwards = up ? std::optional(as_vec3(*up, "up")) : std::nullopt;
        const Vector shares = as_vector(weights, "weights");
        return run_long(task, [&](const Progress& progress) {
          return sharpen(mesh.vertices, mesh.triangles, after, style, options, progress, shares, upwards,
                         contact.value_or(Contact()), alone);
        });
      },
      "vertices"_a, "triangles"_a, "moved"_a, "normals"_a,
      py::arg_v("options", SharpenOptions(), "SharpenOptions()"), py::kw_only(), "weights"_a = py::none(),
      "orientation"_a = py::none(), "up"_a = py::none(), "contact"_a = py::none(), "alone"_a = true,
      "task"_a = py::none(),
      R"(
A mesh's vertices (n, 3), stylized by a field, brought nearer to the style by the mesh's own triangles.

A field is smooth, so it rounds the edges of a style. This takes the vertices `moved` (n, 3) to where the
triangles, as far as they face a preferred normal within 60°, face it more closely, as rigidly as possible.
`normals` and `orientation` are those of stylize. `weights` (n,) scale the effect at each vertex; where they
are 0, vertices stay. With `up` (3,) and no such vertex, the lowest along it keeps its height. In `contact`
vertices enter no obstacle and do not pass the ground; those that `moved` has inside go no further; contact
of the surface with itself is refused. Vertices at one place stay together, loose ones stay where they are,
and no triangle is folded that is not folded in `moved` (folded_triangles).

A strength below 1 is that of the field as well: the result lies that share of the way from rest to the
style's whole shape. Where not the style `alone` has moved the vertices but handles too, or a network, it
scales the style's weight as in stylize; so it does in contact. Raises InvalidInput and Cancelled.)");
  module.def(
      "folded_triangles",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, const ArrayArgument& moved) {
        const TriangleMesh mesh = as_mesh(vertices, triangles);
        const Points after = as_points(moved, "moved");
        const std::vector<Index> rows =
            run_long([&] { return folded_triangles(mesh.vertices, mesh.triangles, after); });
        return Eigen::Matrix<Index, Eigen::Dynamic, 1>(
            Eigen::Map<const Eigen::Matrix<Index, Eigen::Dynamic, 1>>(rows.data(), std::ssize(rows)));
      },
      "vertices"_a, "triangles"_a, "moved"_a,
      R"(
Rows (k,) of the triangles that have turned over in `moved` (n, 3), in ascending order.

Those face away from where their corners turn them; a corner turns as the edges around it do. Triangles
without area are left out. InvalidInput for a broken mesh, and for moved vertices that do not fit.)");
}

}  // namespace arapfields::python
