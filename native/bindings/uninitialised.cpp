// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/uninitialised.h"

namespace arapfields::python {

namespace py = pybind11;

namespace {

void* refuse_memory(std::size_t) {
  throw py::type_error("the object was made by __new__ alone: its __init__ has not been called");
}

}  // namespace

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

}  // namespace arapfields::python
