// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "core/implicit.h"
#include "core/parallel.h"
#include "extraction/extract_deformed.h"

namespace arapfields::python {
namespace {

void fill(const py::dict& report, const ExtractionReport& done) {
  report.attr("update")("evaluations"_a = done.evaluations, "dense_evaluations"_a = done.dense_evaluations,
                        "open"_a = done.open, "seconds"_a = done.seconds, "pieces"_a = done.pieces,
                        "thin_cells"_a = done.thin_cells, "refinement"_a = done.refinement,
                        "holding_resolution"_a = done.holding_resolution, "notes"_a = done.notes);
}

py::tuple extract(const ImplicitFunction& sdf, int resolution, Task* task, int threads,
                  const std::optional<py::dict>& report, bool refine_thin) {
  ExtractionReport done;
  const TriangleMesh mesh = run_long(task, [&](const Progress& progress) {
    const ThreadScope scope(threads);
    return extract_surface(sdf, {.resolution = resolution, .refine_thin = refine_thin}, progress, &done);
  });
  if (report) fill(*report, done);
  return py::make_tuple(mesh.vertices, mesh.triangles);
}

py::tuple extract_moved(const ImplicitFunction& sdf, const DeformationField& field, int resolution,
                        const DeformationField* inverse, Task* task, int threads,
                        const std::optional<py::dict>& report, bool refine_thin) {
  DeformedReport done;
  const TriangleMesh mesh = run_long(task, [&](const Progress& progress) {
    const ThreadScope scope(threads);
    return extract_deformed(sdf, field, inverse, {.resolution = resolution, .refine_thin = refine_thin},
                            progress, &done);
  });
  if (report) {
    fill(*report, done);
    report->attr("update")("inverted"_a = done.inverted, "failures"_a = done.failures,
                           "spacing"_a = done.spacing);
  }
  return py::make_tuple(mesh.vertices, mesh.triangles);
}

}  // namespace

void bind_extraction(py::module_& module) {
  module.def(
      "extract_surface", &extract, "sdf"_a, "resolution"_a = ExtractionOptions().resolution,
      "task"_a = py::none(), "threads"_a = 0, "report"_a = py::none(),
      "refine_thin"_a = ExtractionOptions().refine_thin,
      "The zero surface of a signed distance function as a mesh: V (n,3), F (m,3), in mesh coordinates.\n\n"
      "Marching cubes on `resolution` (8 to 512) grid points a side over the frame's cube, evaluated only\n"
      "where a measured bound on the gradient lets the surface be; the vertices are those of the whole "
      "grid.\n"
      "Triangles are counter-clockwise seen from outside; the mesh is a closed manifold unless the surface\n"
      "leaves the cube. A dict given as `report` receives evaluations and dense_evaluations (points of the\n"
      "grid), open (the mesh has a boundary) and seconds. Where the function jumps, as the distance of an "
      "open\n"
      "soup does across its holes, there is no surface. Where parts are thinner\n"
      "than two cells, refine_thin cuts the cells there into finer ones, without cracks. The report also "
      "has\n"
      "pieces (of the mesh), thin_cells, refinement (steps to a cell there), holding_resolution (one that "
      "holds\n"
      "what came apart, 0 for none found) and notes, which say so in words. InvalidInput for a bad "
      "resolution or\n"
      "no surface.");
  module.def(
      "extract_deformed", &extract_moved, "sdf"_a, "field"_a, "resolution"_a = ExtractionOptions().resolution,
      "inverse"_a = py::none(), "task"_a = py::none(), "threads"_a = 0, "report"_a = py::none(),
      "refine_thin"_a = ExtractionOptions().refine_thin,
      "The deformed surface as the zero set of sdf ∘ field⁻¹: V (n,3), F (m,3), in mesh coordinates.\n\n"
      "Marching cubes on `resolution` (8 to 512) grid points a side over a cube around the deformed "
      "surface;\n"
      "triangles are evenly sized also where the field stretches, which those of extract_surface moved by "
      "the\n"
      "field are not. Rest positions come from Newton's method, or from `inverse`, the field that\n"
      "train_inverse made of this one. They are asked for near the deformed surface alone; farther away\n"
      "extract_surface's mesh, moved, decides the sides. A dict given as `report` receives what "
      "extract_surface's does,\n"
      "and inverted (points asked for), failures (those without a rest position beside the surface, where "
      "the\n"
      "distance to that mesh stands in) and spacing (of the grid, a length). Raises as extract_surface does, "
      "and\n"
      "InvalidInput for a field that is not finite on the surface.");
}

}  // namespace arapfields::python
