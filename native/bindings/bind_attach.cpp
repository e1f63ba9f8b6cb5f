// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/attachment.h"
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "energies/alignment.h"

namespace arapfields::python {

void bind_attach(py::module_& module) {
  py::class_<Attachment>(
      module, "Attachment",
      "Points that go along with a body: clothes, hair, hats, lattices, whatever its motion does not see.\n\n"
      "Within 0.03 of the body's size they go where a field takes them; beyond 0.06 along with rigid frames\n"
      "of the surface, f(p) + R(p) (y − p), several of which share a point, so that nothing tears where the\n"
      "nearest place of the surface jumps; between the two with a mixture. What depends on the rest shapes\n"
      "alone is found once: a live session asks for positions() each frame.")
      .def(py::init([](const SurfaceSamples& samples, const ArrayArgument& points, Task* task) {
             const Points mesh = as_points(points, "points");
             return run_long(task, [&](const Progress& progress) {
               return std::make_unique<Attachment>(samples, mesh, progress);
             });
           }),
           "samples"_a, "points"_a, py::kw_only(), "task"_a = py::none(),
           "samples: SurfaceSamples of the body at rest; points (n, 3) at rest, both in mesh coordinates. "
           "Any\n"
           "objects' points may be put together. InvalidInput for points that are not finite.")
      .def(
          "positions",
          [](const Attachment& self, const DeformationField& field) {
            return run_long(nullptr, [&](const Progress&) { return self.positions(field); });
          },
          "field"_a,
          "Where a DeformationField of the body takes the points: (n, 3). From any thread. Fields of one "
          "live\n"
          "session are evaluated several times faster from the second on.")
      .def_property_readonly(
          "distances", [](const Attachment& self) { return self.distances(); },
          "(n,) from each point to the body's nearest sample, in mesh units.")
      .def("__len__", &Attachment::size)
      .def("__repr__",
           [](const Attachment& self) { return "Attachment(" + std::to_string(self.size()) + " points)"; });
  module.def(
      "rigid_motion",
      [](const ArrayArgument& points, const ArrayArgument& moved,
         const std::optional<ArrayArgument>& weights) {
        return rigid_motion(as_points(points, "points"), as_points(moved, "moved"),
                            weights ? as_vector(*weights, "weights") : Vector());
      },
      "points"_a, "moved"_a, py::kw_only(), "weights"_a = py::none(),
      "The rigid motion (4, 4) that brings points (n, 3) nearest to moved (n, 3), in the least squares\n"
      "weighted by `weights` (n,): never a reflection; a point or a line turns as little as it can. What "
      "must\n"
      "stay rigid, eyes or buttons, takes that of its own vertices. InvalidInput for no points, other "
      "counts,\n"
      "numbers that are not finite or weights below 0.");
}

}  // namespace arapfields::python
