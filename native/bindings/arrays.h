// SPDX-License-Identifier: GPL-3.0-or-later
// Conversion of Python's arrays and sequences.
#pragma once

#include <functional>
#include <vector>

#include "bindings/bind.h"
#include "mesh/triangle_mesh.h"

namespace arapfields::python {

// Accepted are NumPy arrays, objects with the buffer protocol, DLPack (other libraries' tensors, also those
// that require a gradient) or __array__, and nested sequences. Points take integer and float dtypes;
// triangles and indices take integers alone. InvalidInput names `argument` for another shape or dtype, and
// where memory is short.
Points as_points(const py::handle& value, const std::string& argument);
/// The same, refusing NaN and infinity.
Points as_finite_points(const py::handle& value, const std::string& argument);
/// The arguments `vertices` and `triangles`, not yet validated.
TriangleMesh as_mesh(const py::handle& vertices, const py::handle& triangles);
/// A pair of both.
TriangleMesh as_mesh_pair(const py::handle& value, const std::string& argument,
                          const std::string& allowed = "a pair (vertices, triangles) is needed");
Triangles as_triangles(const py::handle& value, const std::string& argument);
Vector as_vector(const py::handle& value, const std::string& argument);
/// The same; empty for an argument that was not given.
template <class Argument>
Vector as_vector(const std::optional<Argument>& value, const std::string& argument) {
  return value ? as_vector(*value, argument) : Vector();
}
Mat4 as_matrix4(const py::handle& value, const std::string& argument);
/// (3,3), orthogonal to 1e-4.
Mat3 as_rotation(const py::handle& value, const std::string& argument);
Vec3 as_vec3(const py::handle& value, const std::string& argument);
/// Any real array as (rows, cols) doubles.
Eigen::MatrixXd as_matrix(const py::handle& value, const std::string& argument);
/// Integers of shape (n,).
std::vector<Index> as_indices(const py::handle& value, const std::string& argument);
/// Real numbers of any shape, contiguous.
py::array_t<double> as_doubles(const py::handle& value, const std::string& argument);

std::string type_text(const py::handle& value);
/// A str; InvalidInput for anything else.
std::string as_text(const py::handle& value, const std::string& argument);

/// Calls take(item, "argument[i]") for the items of anything iterable. InvalidInput where it is not, or where
/// its length times `item_bytes` is more than there is memory for.
void for_each_item(const py::handle& value, const std::string& argument, const std::string& allowed,
                   double item_bytes, const std::function<void(const py::object&, const std::string&)>& take);

/// The items of anything iterable, of one bound class. InvalidInput names the one that is of another.
template <class Item>
std::vector<Item> as_items(const py::handle& value, const std::string& argument, const std::string& allowed) {
  std::vector<Item> items;
  for_each_item(value, argument, allowed, sizeof(Item), [&](const py::object& item, const std::string& name) {
    require(py::isinstance<Item>(item), name, "got " + type_text(item), allowed);
    items.push_back(item.cast<const Item&>());
  });
  return items;
}

/// Shared ownership of a Python object; the last owner may be on any thread and takes the GIL to release it.
std::shared_ptr<py::object> kept_alive(py::object object);

}  // namespace arapfields::python
