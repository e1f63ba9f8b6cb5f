// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "core/errors.h"
#include "core/frame.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/simd_level.h"
#include "tensors/device.h"

namespace arapfields::python {

SignalWatch::SignalWatch() {
  const py::module_ threading = py::module_::import("threading");
  main_thread_ = threading.attr("get_ident")().equal(threading.attr("main_thread")().attr("ident"));
}

bool SignalWatch::look() {
  constexpr auto pause = std::chrono::milliseconds(50);
  if (!main_thread_ || std::this_thread::get_id() != thread_) return false;
  if (raised_) return true;
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < pause) return false;
  last_ = now;
  const py::gil_scoped_acquire acquire;
  if (PyErr_CheckSignals() != 0) raised_.emplace();
  return raised_.has_value();
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
    // Not by errno: on Windows the one of Python's C library is not ours.
    const py::object said = py::module_::import("os").attr("strerror")(error.number());
    const py::object result = py::handle(PyExc_OSError)(error.number(), said, as_text(error.path()));
    PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(result.ptr())), result.ptr());
  } catch (const py::cast_error& error) {
    py::set_error(PyExc_TypeError, error.what());
  } catch (const std::exception& error) {
    const std::optional<BackendError> told = backend_error(error);
    if (!told) throw;
    py::set_error(told->out_of_memory ? PyExc_MemoryError : PyExc_RuntimeError, told->text.c_str());
  }
}

}  // namespace

void bind_core(py::module_& module) {
  // Python's own exceptions: InvalidInput is a ValueError, so that callers may catch either.
  auto& invalid = py::register_exception<InvalidInput>(module, "InvalidInput", PyExc_ValueError);
  auto& cancelled = py::register_exception<Cancelled>(module, "Cancelled", PyExc_RuntimeError);
  auto& diverged = py::register_exception<Diverged>(module, "Diverged", PyExc_RuntimeError);
  invalid.attr("__doc__") = "An invalid argument: names it, the value received and the values allowed.";
  cancelled.attr("__doc__") = "Raised in the caller whose Task was cancelled.";
  diverged.attr("__doc__") =
      "An optimization met NaN or infinity; names the stage and the option to change.\n"
      "Its attribute last_good is the last field, or fit, with finite numbers.";

  py::register_local_exception_translator(&translate);  // errors of other modules stay theirs

  py::class_<Task>(module, "Task", "Cancels a long call and reads its progress, from any thread.")
      .def(py::init<>())
      .def("cancel", method(&Task::cancel),
           "Stops the running call, whose caller gets Cancelled within 0.2 s.")
      .def_property_readonly("cancelled", method(&Task::cancelled))
      .def_property_readonly("progress", method(&Task::progress),
                             "Share of the work done, in [0, 1]; never falls.")
      .def_property_readonly("message", method(&Task::message), "What the call is doing, in a few words.")
      .def("report", &Task::report, "fraction"_a, "message"_a = "",
           "Sets progress (kept if larger already) and message.")
      .def(
          "watch",
          [](Task& self, const ArrayArgument& points, double seconds) {
            self.watch(as_points(points, "points"), seconds);
          },
          "points"_a, "seconds"_a = 0.4, R"(
Requests previews of a later deform, stylize or wrap: positions of these points (n, 3) during the solve.

There is one as soon as the solve has a first field, then one about every `seconds`. They take at most a
third of the solve's time, and its result stays the same.)")
      .def_property_readonly("previews", method(&Task::previews), "Number of previews so far.")
      .def_property_readonly("looks", method(&Task::previews), "Older name of `previews`.")
      .def_property_readonly("watched", method(&Task::watched), R"(
Positions (n, 3) of the watched points in the latest preview, in single precision; (0, 3) before the first.)");

  py::class_<Frame>(module, "Frame",
                    "The map from mesh coordinates to the unit cube: x_cube = (x_mesh - center) / scale.")
      .def(py::init([](const ArrayArgument& center, double scale) {
             const Frame frame{as_vec3(center, "center"), scale};
             require(std::isfinite(scale) && scale > 0, "scale", std::to_string(scale), "must be positive");
             return frame;
           }),
           "center"_a, "scale"_a)
      .def_readonly("center", &Frame::center)
      .def_readonly("scale", &Frame::scale)
      .def(
          "to_cube", [](const Frame& f, const ArrayArgument& p) { return f.to_cube(as_points(p, "points")); },
          "points"_a)
      .def(
          "to_mesh", [](const Frame& f, const ArrayArgument& p) { return f.to_mesh(as_points(p, "points")); },
          "points"_a)
      .def("__eq__", [](const Frame& a, const Frame& b) { return a == b; }, py::is_operator());

  module.def("thread_count", &thread_count,
             "Threads that native calls use unless their options say otherwise.");
  module.def(
      "real_array",
      [](const ArrayArgument& value, const std::string& argument) { return as_doubles(value, argument); },
      "value"_a, "argument"_a, "Any array of real numbers as float64; InvalidInput names the argument.");
  module.def("require_memory", &require_memory, "argument"_a, "bytes"_a,
             "InvalidInput naming the argument where less than `bytes` of memory is free.");
  module.def("simd_level", &simd_level_name,
             "Instruction set of the kernels: baseline, neon, avx2 or avx512.");
}

}  // namespace arapfields::python
