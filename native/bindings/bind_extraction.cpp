// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "core/parallel.h"
#include "extraction/extract_surface.h"
#include "neural/neural_sdf.h"

namespace arapfields::python {
namespace {

py::tuple extract(const ImplicitFunction& sdf, int resolution, Task* task, int threads,
                  const std::optional<py::dict>& report) {
  const auto* network = dynamic_cast<const NeuralSdf*>(&sdf);
  ExtractionReport done;
  const TriangleMesh mesh = run_long(task, [&](const Progress& progress) {
    const ThreadScope scope(threads);
    return extract_surface(sdf, network != nullptr ? network->frame() : Frame(), resolution, progress, &done);
  });
  if (report)
    report->attr("update")("evaluations"_a = done.evaluations, "dense_evaluations"_a = done.dense_evaluations,
                           "open"_a = done.open, "seconds"_a = done.seconds);
  return py::make_tuple(mesh.vertices, mesh.triangles);
}

}  // namespace

void bind_extraction(py::module_& module) {
  module.def(
      "extract_surface", &extract, "sdf"_a, "resolution"_a = 256, "task"_a = py::none(), "threads"_a = 0,
      "report"_a = py::none(),
      "The zero surface of a signed distance function as a mesh: V (n,3), F (m,3), in mesh coordinates.\n\n"
      "Marching cubes on `resolution` (8 to 512) grid points a side over the frame's cube, evaluated only\n"
      "where a measured bound on the gradient lets the surface be; the vertices are those of the whole "
      "grid.\n"
      "Triangles are counter-clockwise seen from outside; the mesh is a closed manifold unless the surface\n"
      "leaves the cube. A dict given as `report` receives evaluations and dense_evaluations (points of the\n"
      "grid), open (the mesh has a boundary) and seconds. InvalidInput for a bad resolution or no surface.");
}

}  // namespace arapfields::python
