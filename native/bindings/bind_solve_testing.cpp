// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "core/aten_path.h"
#include "options/deform.h"
#include "solve/loss_probe.h"

namespace arapfields::python {
void bind_solve_testing(py::module_& module) {
  py::module_ testing = testing_module(module);
  testing.def("thickness", &probe_thickness, "samples"_a);
  testing.def(
      "bending", [](const SurfaceSamples& s, const DeformOptions& o) { return probe_bending(s, o.surface); },
      "samples"_a, "options"_a);
  py::class_<LossProbe>(testing, "LossProbe")
      .def(py::init<const SurfaceSamples&, const std::vector<Handle>&, int, double, const Points&, double,
                    double, double, double>(),
           "samples"_a, "handles"_a, "width"_a = 8, "bending"_a = 0.0, "preferred"_a = Points(),
           "gauss"_a = 0.0, "barrier"_a = 0.0, "margin"_a = 0.0, "keep_stance"_a = 0.0)
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
