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

/// NumPy input → our arrays. Shapes and dtypes that do not fit raise InvalidInput naming `argument`;
/// (real) integer and float dtypes are accepted for points, integers alone for triangles.
Points as_points(const py::handle& value, const std::string& argument);
Triangles as_triangles(const py::handle& value, const std::string& argument);
Vector as_vector(const py::handle& value, const std::string& argument);
Mat4 as_matrix4(const py::handle& value, const std::string& argument);
Vec3 as_vec3(const py::handle& value, const std::string& argument);
/// Any real array as (rows, cols) doubles.
Eigen::MatrixXd as_matrix(const py::handle& value, const std::string& argument);

/// Raises Python's Diverged with the state that was kept as its attribute `last_good`.
[[noreturn]] void raise_diverged(const Diverged& error, const py::object& last_good);

void bind_core(py::module_& module);
void bind_options(py::module_& module);
void bind_mesh(py::module_& module);
void bind_distance(py::module_& module);
void bind_neural(py::module_& module);
void bind_mesh_sdf(py::module_& module);
void bind_sampling(py::module_& module);
void bind_fit(py::module_& module);
void bind_fields(py::module_& module);
void bind_energies(py::module_& module);
void bind_solve(py::module_& module);
void bind_extraction(py::module_& module);
void bind_live(py::module_& module);
void bind_curves(py::module_& module);
void bind_solve_testing(py::module_& module);

}  // namespace arapfields::python
