// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "bindings/python_function.h"
#include "core/aten_path.h"
#include "options/deform.h"
#include "solve/trained/loss_probe.h"

namespace arapfields::python {
void bind_solve_testing(py::module_& module) {
  py::module_ testing = testing_module(module);
  testing.def("thickness", &probe_thickness, "samples"_a);
  testing.def(
      "bending", [](const SurfaceSamples& s, const DeformOptions& o) { return probe_bending(s, o.surface); },
      "samples"_a, "options"_a);
  testing.def(
      "radial_rows",
      [](const RadialField& field, const Points& cube_points, int count) {
        require(count == 1 || count == 4 || count == 10, "columns", std::to_string(count),
                "1, 4 or 10 are needed");
        return probe_radial_rows(field, cube_points, static_cast<JetOrder>(count));
      },
      "field"_a, "cube_points"_a, "columns"_a,
      "Jets of the field's own basis functions: (columns·n, size), column by column.");
  py::class_<LossProbe>(testing, "LossProbe")
      .def(py::init([](const SurfaceSamples& samples, const std::vector<Handle>& handles, int width,
                       double bending, const Points& preferred, double gauss, double barrier, double margin,
                       double keep_stance, const py::object& energies) {
             return std::make_unique<LossProbe>(samples, handles, width, bending, preferred, gauss, barrier,
                                                margin, keep_stance, as_energies(energies, samples.frame));
           }),
           "samples"_a, "handles"_a, "width"_a = 8, "bending"_a = 0.0, "preferred"_a = Points(),
           "gauss"_a = 0.0, "barrier"_a = 0.0, "margin"_a = 0.0, "keep_stance"_a = 0.0,
           "energies"_a = py::tuple())
      .def(
          "__call__",
          [](LossProbe& self, const Vector& parameters, std::uint64_t seed) {
            const LossGradient found = self(parameters, seed);
            return py::make_tuple(found.loss, found.gradient);
          },
          "parameters"_a, "seed"_a = 0)
      .def_property_readonly("size", &LossProbe::size);
  py::class_<AtenPathScope, std::unique_ptr<AtenPathScope>>(
      testing, "AtenPath", "While it lives, tensors are worked on as on a device instead of by kernels.")
      .def(py::init<>());
  py::class_<EnergyTrial>(testing, "EnergyTrial", "The energy and its parameter gradient, for timing.")
      .def(py::init<const SurfaceSamples&, Index, double>(), "samples"_a, "batch"_a, "bending"_a)
      .def("run", &EnergyTrial::run, py::call_guard<py::gil_scoped_release>());
}

}  // namespace arapfields::python
