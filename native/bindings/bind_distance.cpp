// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "core/parallel.h"
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

}  // namespace arapfields::python
