// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/files.h"
#include "io/output_file.h"

namespace arapfields::python {

std::string as_path(const py::object& path) {
  py::object bytes;
  try {
    bytes = py::module_::import("os").attr("fsencode")(path);
  } catch (const py::error_already_set&) {
    throw InvalidInput("path", "got " + py::cast<std::string>(py::str(py::type::of(path))),
                       "the path of a file is needed");
  }
  const std::string text = py::cast<py::bytes>(bytes);
  require(!text.empty(), "path", "it is empty", "the path of a file is needed");
  require(text.find('\0') == std::string::npos, "path", "it holds a NUL", "the path of a file is needed");
  return text;
}

std::string report_text(const py::object& report) {
  return py::cast<std::string>(py::module_::import("arapfields._report_files").attr("to_json")(report));
}

py::object report_from(const std::string& text, const std::string& place) {
  try {
    return py::module_::import("arapfields._report_files").attr("from_json")(text);
  } catch (const py::error_already_set& error) {
    if (!error.matches(PyExc_Exception)) throw;
    throw InvalidInput(place + ": " + py::cast<std::string>(py::str(error.value())));
  }
}

void bind_io(py::module_& module) {
  py::class_<OutputFile>(
      module, "OutputFile",
      "A regular file that takes its place whole or not at all: write `partial` (or the file `beside` it),\n"
      "then commit(). Symbolic links are followed, permissions stay; what a killed process left is removed "
      "by\n"
      "the next output of the same name. OSError where the system refuses, InvalidInput for a place that is\n"
      "no regular file and where nothing arrived.")
      .def(py::init([](const PathArgument& path) { return std::make_unique<OutputFile>(as_path(path)); }),
           "path"_a)
      .def_property_readonly(
          "partial",
          [](const OutputFile& self) {
            return py::str(py::module_::import("os").attr("fsdecode")(py::bytes(self.partial())));
          },
          "Where to write: a file of the same name in a temporary folder beside its place.")
      .def_property_readonly(
          "beside",
          [](const OutputFile& self) {
            return py::str(py::module_::import("os").attr("fsdecode")(py::bytes(self.beside())));
          },
          "The same in the place's own folder, for content with paths relative to it.")
      .def("finish", &OutputFile::finish, py::call_guard<py::gil_scoped_release>(),
           "Brings the content to the disk and looks at it.")
      .def("commit", &OutputFile::commit, py::call_guard<py::gil_scoped_release>(),
           "finish(), if that has not been done, and the new name.")
      .def("discard", &OutputFile::discard, "Removes what has not been committed.");
}

}  // namespace arapfields::python
