// SPDX-License-Identifier: GPL-3.0-or-later
#include <cerrno>

#include "bindings/bind.h"
#include "core/file_error.h"
#include "core/frame.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/simd_level.h"

namespace arapfields::python {
namespace {

std::string shape_text(const py::array& array) {
  return "shape " + py::cast<std::string>(py::str(array.attr("shape"))) + ", dtype " +
         py::cast<std::string>(py::str(array.dtype()));
}

py::array as_array(const py::handle& value, const std::string& argument, const std::string& kinds,
                   const std::string& allowed) {
  py::array array = py::array::ensure(py::reinterpret_borrow<py::object>(value));
  if (!array) {
    PyErr_Clear();
    throw InvalidInput(argument, "got " + py::cast<std::string>(py::str(py::type::of(value))), allowed);
  }
  require(kinds.find(array.dtype().kind()) != std::string::npos, argument, shape_text(array), allowed);
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

Points as_points(const py::handle& value, const std::string& argument) {
  return as_rows_of_three<Points, double>(value, argument, "fiu", "expected real numbers of shape (n, 3)");
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

Vec3 as_vec3(const py::handle& value, const std::string& argument) {
  const Vector vector = as_vector(value, argument);
  require(vector.size() == 3, argument, std::to_string(vector.size()) + " numbers", "expected three");
  require(vector.allFinite(), argument, "NaN or infinite", "expected finite numbers");
  return vector;
}

void raise_diverged(const Diverged& error, const py::object& last_good) {
  const py::object type = py::module_::import("arapfields._native").attr("Diverged");
  const py::object raised = type(error.what());
  raised.attr("last_good") = last_good;
  PyErr_SetObject(type.ptr(), raised.ptr());
  throw py::error_already_set();
}

namespace {

/// Text as Python shows it; names of files may hold bytes that are no UTF-8.
py::str as_text(const std::string& text) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<py::ssize_t>(text.size()), "surrogateescape"));
}

void translate(std::exception_ptr raised) {
  try {
    std::rethrow_exception(raised);
  } catch (const InvalidInput& error) {
    const py::object type = py::module_::import("arapfields._native").attr("InvalidInput");
    PyErr_SetObject(type.ptr(), as_text(error.what()).ptr());
  } catch (const FileError& error) {
    errno = error.number();
    PyErr_SetFromErrnoWithFilenameObject(PyExc_OSError, as_text(error.path()).ptr());
  } catch (const py::cast_error& error) {
    py::set_error(PyExc_TypeError, error.what());
  }
}

}  // namespace

void bind_core(py::module_& module) {
  // Python's own exceptions: InvalidInput is a ValueError, so that callers may catch either.
  auto& invalid = py::register_exception<InvalidInput>(module, "InvalidInput", PyExc_ValueError);
  auto& cancelled = py::register_exception<Cancelled>(module, "Cancelled", PyExc_RuntimeError);
  auto& diverged = py::register_exception<Diverged>(module, "Diverged", PyExc_RuntimeError);
  invalid.attr("__doc__") = "An argument that cannot be used; names it, what was found and what is allowed.";
  cancelled.attr("__doc__") = "Raised in the caller whose Task was cancelled.";
  diverged.attr("__doc__") =
      "An optimization met NaN or infinity; names the stage and what to change.\n"
      "Its attribute last_good is the field, or the fit, before that.";

  py::register_exception_translator(&translate);

  py::class_<Task>(module, "Task", "Cancels a long call and reads its progress, from any thread.")
      .def(py::init<>())
      .def("cancel", &Task::cancel, "Asks the running call to stop; its caller gets Cancelled within 0.2 s.")
      .def_property_readonly("cancelled", &Task::cancelled)
      .def_property_readonly("progress", &Task::progress, "Share of the work done, in [0, 1]; never falls.")
      .def_property_readonly("message", &Task::message, "What is being done, in a few words.")
      .def("report", &Task::report, "fraction"_a, "message"_a = "",
           "Sets progress (kept if larger already) and message.")
      .def(
          "watch",
          [](Task& self, const py::object& points, double seconds) {
            self.watch(as_points(points, "points"), seconds);
          },
          "points"_a, "seconds"_a = 0.4,
          "Before a call of deform or stylize: it shall say about every `seconds` where its field takes "
          "these\n"
          "points (n, 3), given a third of its time at most. The result of the call stays the same.")
      .def_property_readonly("looks", &Task::looks, "How often the watched points were looked at.")
      .def_property_readonly("watched", &Task::watched,
                             "Where the watched points were then, (n, 3) single precision; empty at first.");

  py::class_<Frame>(module, "Frame",
                    "Mesh coordinates and the unit cube: x_cube = (x_mesh - center) / scale.")
      .def(py::init([](const py::object& center, double scale) {
             const Frame frame{as_vec3(center, "center"), scale};
             require(std::isfinite(scale) && scale > 0, "scale", std::to_string(scale), "must be positive");
             return frame;
           }),
           "center"_a, "scale"_a)
      .def_readonly("center", &Frame::center)
      .def_readonly("scale", &Frame::scale)
      .def(
          "to_cube", [](const Frame& f, const py::object& p) { return f.to_cube(as_points(p, "points")); },
          "points"_a)
      .def(
          "to_mesh", [](const Frame& f, const py::object& p) { return f.to_mesh(as_points(p, "points")); },
          "points"_a)
      .def("__eq__", [](const Frame& a, const Frame& b) { return a == b; });

  module.def("thread_count", &thread_count,
             "Threads that native calls use unless their options say otherwise.");
  module.def("require_memory", &require_memory, "argument"_a, "bytes"_a,
             "InvalidInput naming the argument where the machine has less memory to spare than `bytes`.");
  module.def("simd_level", &simd_level_name, "Instruction set of the kernels: baseline, avx2 or avx512.");
}

}  // namespace arapfields::python
