// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "bindings/files.h"

namespace arapfields::python {
namespace {

void* refuse_memory(std::size_t) {
  throw py::type_error("the object was made by __new__ alone: its __init__ has not been called");
}

/// Has each class refuse, with a TypeError, an object of which __init__ has not been called.
void refuse_uninitialised(const py::module_& module) {
  // pybind11 allocates a value where an object without one is used, and would then read uninitialised memory.
  for (const auto& [name, value] : py::dict(module.attr("__dict__")))
    if (PyType_Check(value.ptr()) != 0) {
      if (auto* known = py::detail::get_type_info(reinterpret_cast<PyTypeObject*>(value.ptr())))
        known->operator_new = &refuse_memory;
    } else if (py::isinstance<py::module_>(value)) {
      refuse_uninitialised(py::reinterpret_borrow<py::module_>(value));
    }
}

}  // namespace
}  // namespace arapfields::python

PYBIND11_MODULE(_native, module) {
  using namespace arapfields::python;
  module.doc() = "Native part of arapfields.";
  module.attr("__version__") = ARAPFIELDS_VERSION;
  stop_in_numpy();
  bind_core(module);
  bind_options(module);
  bind_mesh(module);
  bind_distance(module);
  bind_neural(module);
  bind_mesh_sdf(module);
  bind_sampling(module);
  bind_fit(module);
  bind_fields(module);
  bind_energies(module);
  bind_object_style(module);
  bind_contact(module);
  bind_solve(module);
  bind_extraction(module);
  bind_radial(module);
  bind_wrap(module);
  bind_attach(module);
  bind_curve(module);
  bind_sharpen(module);
  bind_skin(module);
  bind_splats(module);
  bind_io(module);
  bind_solve_testing(module);
  bind_invertible_testing(module);
  refuse_uninitialised(module);
}
