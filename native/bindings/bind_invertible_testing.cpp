// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "fields/invertible_probe.h"

namespace arapfields::python {

void bind_invertible_testing(py::module_& module) {
  testing_module(module).def(
      "invertible_field",
      [](int width, int layers, int octaves, int couplings, const Vector& parameters, const Points& points,
         int columns, const Vector& cotangents) {
        CouplingShape shape;
        shape.width = width, shape.layers = layers, shape.octaves = octaves, shape.couplings = couplings;
        const InvertibleProbe probe =
            probe_invertible(shape, parameters, points, static_cast<JetOrder>(columns), cotangents);
        return py::make_tuple(probe.jets, probe.gradient, probe.preimages);
      },
      "width"_a, "layers"_a, "octaves"_a, "couplings"_a, "parameters"_a, "points"_a, "columns"_a,
      "cotangents"_a);
}

}  // namespace arapfields::python
