// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"

#include "core/memory.h"

namespace arapfields::python {
namespace {

std::string shape_text(const py::array& array) {
  return "shape " + py::cast<std::string>(py::str(array.attr("shape"))) + ", dtype " +
         py::cast<std::string>(py::str(array.dtype()));
}

/// The object as a NumPy array, by DLPack where it has that (no copy).
py::object to_numpy(py::object value) {
  const py::module_ numpy = py::module_::import("numpy");
  if (!py::hasattr(value, "__dlpack__")) return numpy.attr("asarray")(value);
  if (py::hasattr(value, "detach"))
    value = value.attr("detach")();  // tensors that require a gradient refuse DLPack
  return numpy.attr("from_dlpack")(value);
}

py::array as_array(const py::handle& value, const std::string& argument, const std::string& kinds,
                   const std::string& allowed) {
  py::array array;
  try {
    const auto given = py::reinterpret_borrow<py::object>(value);
    array = py::isinstance<py::array>(value) ? py::array(given) : py::array(to_numpy(given));
  } catch (const py::error_already_set& error) {
    if (!error.matches(PyExc_Exception)) throw;  // Ctrl-C
    throw InvalidInput(
        argument,
        "got " + type_text(value) + ", of which NumPy says: " + py::cast<std::string>(py::str(error.value())),
        allowed);
  }
  const std::string received = array.ndim() == 0 ? "got " + type_text(value) : shape_text(array);
  require(kinds.find(array.dtype().kind()) != std::string::npos, argument, received, allowed);
  return array;
}

template <class Scalar>
using Forced = py::array_t<Scalar, py::array::c_style | py::array::forcecast>;

/// The array's numbers one after the other as Scalar. InvalidInput where there is no memory for them: an
/// array may be larger than what it takes (np.broadcast_to).
template <class Scalar>
Forced<Scalar> as_numbers(const py::array& array, const std::string& argument) {
  const double size = static_cast<double>(array.size()) * sizeof(Scalar);
  require_memory(argument, 2.0 * size);  // and once more as a matrix of ours
  Forced<Scalar> numbers = Forced<Scalar>::ensure(array);
  require(static_cast<bool>(numbers), argument, shape_text(array),
          "it cannot be converted: there may be no memory for it");
  return numbers;
}

template <class Result, class Scalar>
Result as_rows_of_three(const py::handle& value, const std::string& argument, const std::string& kinds,
                        const std::string& allowed) {
  const py::array array = as_array(value, argument, kinds, allowed);
  require(array.ndim() == 2 && array.shape(1) == 3, argument, shape_text(array), allowed);
  const Forced<Scalar> forced = as_numbers<Scalar>(array, argument);
  return Eigen::Map<const Result>(forced.data(), forced.shape(0), 3);
}

}  // namespace

std::string type_text(const py::handle& value) { return py::cast<std::string>(py::str(py::type::of(value))); }

std::string as_text(const py::handle& value, const std::string& argument) {
  require(py::isinstance<py::str>(value), argument, "got " + type_text(value), "a name is needed");
  return py::cast<std::string>(value);
}

Points as_points(const py::handle& value, const std::string& argument) {
  return as_rows_of_three<Points, double>(value, argument, "fiu", "expected real numbers of shape (n, 3)");
}

Points as_finite_points(const py::handle& value, const std::string& argument) {
  Points points = as_points(value, argument);
  require(points.allFinite(), argument, "some coordinates are NaN or infinite", "all must be finite");
  return points;
}

TriangleMesh as_mesh(const py::handle& vertices, const py::handle& triangles) {
  return {as_points(vertices, "vertices"), as_triangles(triangles, "triangles")};
}

TriangleMesh as_mesh_pair(const py::handle& value, const std::string& argument, const std::string& allowed) {
  std::vector<py::object> parts;
  for_each_item(value, argument, allowed, 0.0, [&](const py::object& part, const std::string&) {
    require(parts.size() < 2, argument, "more than two of them", allowed);
    parts.push_back(part);
  });
  require(parts.size() == 2, argument, std::to_string(parts.size()) + " of them", allowed);
  return as_mesh(parts[0], parts[1]);
}

Triangles as_triangles(const py::handle& value, const std::string& argument) {
  const std::string allowed = "expected integers of shape (m, 3) that fit 32 bits";
  using Wide = Eigen::Matrix<std::int64_t, Eigen::Dynamic, 3, Eigen::RowMajor>;
  const Wide wide = as_rows_of_three<Wide, std::int64_t>(value, argument, "iu", allowed);
  if (wide.size() > 0)
    require(wide.minCoeff() >= INT32_MIN && wide.maxCoeff() <= INT32_MAX, argument, "an index is too large",
            allowed);
  return wide.cast<std::int32_t>();
}

Eigen::MatrixXd as_matrix(const py::handle& value, const std::string& argument) {
  const std::string allowed = "expected real numbers in a two-dimensional array";
  const py::array array = as_array(value, argument, "fiu", allowed);
  require(array.ndim() == 2, argument, shape_text(array), allowed);
  const Forced<double> forced = as_numbers<double>(array, argument);
  return Eigen::Map<const RowMatrix<double>>(forced.data(), forced.shape(0), forced.shape(1));
}

Vector as_vector(const py::handle& value, const std::string& argument) {
  const std::string allowed = "expected real numbers of shape (n,)";
  const py::array array = as_array(value, argument, "fiu", allowed);
  require(array.ndim() == 1, argument, shape_text(array), allowed);
  const Forced<double> forced = as_numbers<double>(array, argument);
  return Eigen::Map<const Vector>(forced.data(), forced.shape(0));
}

Mat4 as_matrix4(const py::handle& value, const std::string& argument) {
  const Eigen::MatrixXd matrix = as_matrix(value, argument);
  require(matrix.rows() == 4 && matrix.cols() == 4, argument,
          "shape (" + std::to_string(matrix.rows()) + ", " + std::to_string(matrix.cols()) + ")",
          "expected a 4×4 matrix");
  require(matrix.allFinite(), argument, "some entries are NaN or infinite", "all entries must be finite");
  return matrix;
}

Mat3 as_rotation(const py::handle& value, const std::string& argument) {
  const Eigen::MatrixXd turn = as_matrix(value, argument);
  require(turn.rows() == 3 && turn.cols() == 3 && turn.allFinite() &&
              (turn.transpose() * turn - Eigen::MatrixXd::Identity(3, 3)).norm() < 1e-4,
          argument, "not an orthogonal 3×3 matrix", "a rotation is needed");
  return turn;
}

Vec3 as_vec3(const py::handle& value, const std::string& argument) {
  const Vector vector = as_vector(value, argument);
  require(vector.size() == 3, argument, std::to_string(vector.size()) + " numbers", "expected three");
  require(vector.allFinite(), argument, "NaN or infinite", "expected finite numbers");
  return vector;
}

std::vector<Index> as_indices(const py::handle& value, const std::string& argument) {
  const std::string allowed = "expected integers of shape (n,)";
  const py::array array = as_array(value, argument, "fiu", allowed);
  const bool none = array.ndim() == 1 && array.size() == 0;  // NumPy takes [] for floats
  require(none || (array.ndim() == 1 && array.dtype().kind() != 'f'), argument, shape_text(array), allowed);
  const Forced<Index> forced = as_numbers<Index>(array, argument);
  return {forced.data(), forced.data() + forced.size()};
}

py::array_t<double> as_doubles(const py::handle& value, const std::string& argument) {
  return as_numbers<double>(as_array(value, argument, "fiu", "expected real numbers"), argument);
}

void for_each_item(const py::handle& value, const std::string& argument, const std::string& allowed,
                   double item_bytes,
                   const std::function<void(const py::object&, const std::string&)>& take) {
  const auto items = py::reinterpret_steal<py::object>(PyObject_GetIter(value.ptr()));
  if (!items) {
    const py::error_already_set error;
    if (!error.matches(PyExc_Exception)) throw error;
    throw InvalidInput(argument, "got " + type_text(value), allowed);
  }
  const py::ssize_t length = PyObject_LengthHint(value.ptr(), 0);
  if (length < 0) throw py::error_already_set();
  bool first = true;
  Index count = 0;
  while (auto item = py::reinterpret_steal<py::object>(PyIter_Next(items.ptr()))) {
    take(item, argument + "[" + std::to_string(count++) + "]");
    // After the first: what is wrong with an item says more than that there are many of them.
    if (first) require_memory(argument, item_bytes * static_cast<double>(length));
    first = false;
  }
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
}

std::shared_ptr<py::object> kept_alive(py::object object) {
  return {new py::object(std::move(object)), [](py::object* held) {
            const py::gil_scoped_acquire acquire;
            delete held;
          }};
}

}  // namespace arapfields::python
