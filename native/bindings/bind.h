// SPDX-License-Identifier: GPL-3.0-or-later
// What every bind_<folder>.cpp shares.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "bindings/run_long.h"
#include "core/errors.h"
#include "core/task.h"
#include "core/types.h"

namespace arapfields::python {

namespace py = pybind11;
using namespace pybind11::literals;

/// Raises Python's Diverged with the state that was kept as its attribute `last_good`.
[[noreturn]] void raise_diverged(const Diverged& error, const py::object& last_good);

void bind_core(py::module_& module);
void bind_options(py::module_& module);
void bind_mesh(py::module_& module);
void bind_distance(py::module_& module);
void bind_implicit(py::module_& module);
void bind_neural(py::module_& module);
void bind_mesh_sdf(py::module_& module);
void bind_sampling(py::module_& module);
void bind_fit(py::module_& module);
void bind_fields(py::module_& module);
void bind_energies(py::module_& module);
void bind_object_style(py::module_& module);
void bind_solve(py::module_& module);
void bind_wrap(py::module_& module);
void bind_extraction(py::module_& module);
void bind_radial(py::module_& module);
void bind_attach(py::module_& module);
void bind_curve(py::module_& module);
void bind_sharpen(py::module_& module);
void bind_skin(py::module_& module);
void bind_splats(py::module_& module);
void bind_contact(py::module_& module);
void bind_solve_testing(py::module_& module);
void bind_invertible_testing(py::module_& module);

}  // namespace arapfields::python
