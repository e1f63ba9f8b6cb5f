// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/attachment.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "energies/alignment.h"

namespace arapfields::python {

void bind_attach(py::module_& module) {
  py::class_<Attachment>(module, "Attachment",
                         R"(
Points carried along by a body, such as clothes, hair, hats or lattices, that its samples do not contain.

Within 0.03 of the body's size, points move with the field. Beyond 0.06 they move with rigid frames of the
surface, f(p) + R(p) (y − p). Several frames blend at each point, so that nothing tears where the nearest
frame changes. Between the two distances both are mixed; under a style, whose field is steep off the surface,
both shrink to a third. With a field that is not radial, such as a wrap's, distances grow as the root of the
surface's area does. Everything that depends on the rest shapes alone is computed once; positions() is cheap
enough for each frame of a live session.)")
      .def(py::init([](const SurfaceSamples& samples, const ArrayArgument& points, Task* task) {
             const Points mesh = as_points(points, "points");
             return run_long(task, [&](const Progress& progress) {
               return std::make_unique<Attachment>(samples, mesh, progress);
             });
           }),
           "samples"_a, "points"_a, py::kw_only(), "task"_a = py::none(),
           R"(
samples: SurfaceSamples of the body at rest; points (n, 3) at rest, both in mesh coordinates.

Points of several objects may be concatenated. InvalidInput for points that are not finite.)")
      .def(
          "positions",
          [](const Attachment& self, const DeformationField& field) {
            return run_long([&] { return self.positions(field); });
          },
          "field"_a, R"(
The points (n, 3), moved by a DeformationField of the body. May be called from any thread.

Fields of one live session are evaluated several times faster from the second one on.)")
      .def_property_readonly(
          "distances", [](const Attachment& self) { return self.distances(); },
          "(n,) from each point to the body's nearest sample, in mesh units.")
      .def("__len__", method(&Attachment::size))
      .def("__repr__",
           [](const Attachment& self) { return "Attachment(" + std::to_string(self.size()) + " points)"; });
  module.def(
      "rigid_motion",
      [](const ArrayArgument& points, const ArrayArgument& moved,
         const std::optional<ArrayArgument>& weights) {
        return rigid_motion(as_points(points, "points"), as_points(moved, "moved"),
                            as_vector(weights, "weights"));
      },
      "points"_a, "moved"_a, py::kw_only(), "weights"_a = py::none(),
      R"(
The rigid motion (4, 4) that maps points (n, 3) closest to moved (n, 3), in least squares.

`weights` (n,) ≥ 0 weight the squares. Never a reflection; a single point or a line rotates as little as
possible. Parts that must stay rigid, such as eyes or buttons, take the motion of their own vertices. Source:
Kabsch 1976. InvalidInput for no points, other counts, non-finite numbers and negative weights.)");
}

}  // namespace arapfields::python
