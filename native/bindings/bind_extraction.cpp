// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/reports.h"
#include "core/implicit.h"
#include "core/parallel.h"
#include "extraction/extract_deformed.h"

namespace arapfields::python {
namespace {

py::dict fields(const ExtractionReport& done) {
  return py::dict("evaluations"_a = done.evaluations, "dense_evaluations"_a = done.dense_evaluations,
                  "open"_a = done.open, "seconds"_a = done.seconds, "pieces"_a = done.pieces,
                  "thin_cells"_a = done.thin_cells, "refinement"_a = done.refinement,
                  "holding_resolution"_a = done.holding_resolution,
                  "notes"_a = py::tuple(py::cast(done.notes)));
}

py::object extraction(const TriangleMesh& mesh, const py::object& report) {
  return py::module_::import("arapfields.reports").attr("Extraction")(mesh.vertices, mesh.triangles, report);
}

ExtractionResult extract(const ImplicitFunction& sdf, int resolution, bool refine_thin, int threads,
                         Task* task) {
  ExtractionReport done;
  const TriangleMesh mesh = run_long(task, [&](const Progress& progress) {
    const ThreadScope scope(threads);
    return extract_surface(sdf, {.resolution = resolution, .refine_thin = refine_thin}, progress, &done);
  });
  return extraction(mesh, make_report("ExtractionReport", **fields(done)));
}

DeformedExtractionResult extract_moved(const ImplicitFunction& sdf, const DeformationField& field,
                                       int resolution, bool refine_thin, const DeformationField* inverse,
                                       int threads, Task* task) {
  DeformedReport done;
  const TriangleMesh mesh = run_long(task, [&](const Progress& progress) {
    const ThreadScope scope(threads);
    return extract_deformed(sdf, field, inverse, {.resolution = resolution, .refine_thin = refine_thin},
                            progress, &done);
  });
  return extraction(mesh,
                    make_report("DeformedExtractionReport", "inverted"_a = done.inverted,
                                "failures"_a = done.failures, "spacing"_a = done.spacing, **fields(done)));
}

}  // namespace

void bind_extraction(py::module_& module) {
  module.def("extract_surface", &extract, "sdf"_a, "resolution"_a = ExtractionOptions().resolution,
             py::kw_only(), "refine_thin"_a = ExtractionOptions().refine_thin, "threads"_a = 0,
             "task"_a = py::none(),
             R"(
The zero surface of a signed distance function as a mesh: V (n, 3), F (m, 3), in mesh coordinates.

Marching cubes on `resolution` (8 to 512) grid points a side over the frame's cube. The function is evaluated
only where a bound on its gradient allows the surface to be; the vertices are those of the whole grid.
Triangles are counter-clockwise seen from outside. The mesh is a closed manifold unless the surface leaves the
cube, or the function jumps there, as the distance to an open soup does across its holes. The result unpacks
into V and F and has a `report`.

Where parts are thinner than two cells, refine_thin cuts the cells there into finer ones, without cracks; the
report says whether the surface came apart and which resolution holds it together. InvalidInput for a bad
resolution and for a function without a zero surface.)");
  module.def("extract_deformed", &extract_moved, "sdf"_a, "field"_a,
             "resolution"_a = ExtractionOptions().resolution, py::kw_only(),
             "refine_thin"_a = ExtractionOptions().refine_thin, "inverse"_a = py::none(), "threads"_a = 0,
             "task"_a = py::none(),
             R"(
The deformed surface as the zero set of sdf ∘ field⁻¹: V (n, 3), F (m, 3), in mesh coordinates.

Marching cubes on `resolution` (8 to 512) grid points a side over a cube around the deformed surface. Unlike
the vertices of extract_surface moved by the field, the triangles have the same size where the field
stretches. Rest positions come from Newton's method, or from `inverse`, a field of train_inverse. They are
evaluated near the deformed surface alone; farther away, the moved mesh of extract_surface decides the sign.
Returns and raises as extract_surface does, and raises InvalidInput for a field that is not finite on the
surface.)");
}

}  // namespace arapfields::python
