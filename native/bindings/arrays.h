// SPDX-License-Identifier: GPL-3.0-or-later
// Python's arrays, from wherever they come, as ours.
#pragma once

#include <functional>
#include <vector>

#include "bindings/bind.h"

namespace arapfields::python {

// NumPy arrays, what has the buffer protocol, DLPack (torch's tensors, also those that want a gradient) or
// __array__, and nested sequences. Shapes and dtypes that do not fit raise InvalidInput naming `argument`, as
// do arrays for which there is no memory; (real) integer and float dtypes are accepted for points, integers
// alone for triangles and indices.
Points as_points(const py::handle& value, const std::string& argument);
Triangles as_triangles(const py::handle& value, const std::string& argument);
Vector as_vector(const py::handle& value, const std::string& argument);
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

/// `given`, kept alive for C++ that may let go of it on any thread.
std::shared_ptr<py::object> kept_alive(py::object given);

}  // namespace arapfields::python
