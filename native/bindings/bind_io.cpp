// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/files.h"
#include "core/task.h"
#include "io/output_file.h"

namespace arapfields::python {
namespace {

py::str from_path(const std::string& path) {
  return py::str(py::module_::import("os").attr("fsdecode")(py::bytes(path)));
}

/// What Python holds: its methods may be called from any thread.
using Output = OneAtATime<OutputFile>;

template <class Method>
auto run_alone(Output& output, Method method) {
  return run_long(nullptr, [&](const Progress& progress) {
    return output.run(progress, [&](OutputFile& file) { return (file.*method)(); });
  });
}

}  // namespace

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
  py::class_<Output>(module, "OutputFile",
                     R"(
A regular file that replaces its target in whole or not at all: write `partial` (or `beside`), then commit().

Symbolic links are followed and permissions kept. The next output of the same name removes what a killed
process left. OSError where the system refuses; InvalidInput for a path that is not a regular file, and where
nothing was written.)")
      .def(py::init([](const PathArgument& path) { return std::make_unique<Output>(as_path(path)); }),
           "path"_a)
      .def_property_readonly(
          "partial", [](Output& self) { return from_path(run_alone(self, &OutputFile::partial)); },
          "Path to write to: a file of the same name in a temporary folder beside the target.")
      .def_property_readonly(
          "beside", [](Output& self) { return from_path(run_alone(self, &OutputFile::beside)); },
          "The same in the target's own folder, for content with paths relative to it.")
      .def(
          "finish", [](Output& self) { run_alone(self, &OutputFile::finish); },
          "Flushes the content to the disk and verifies it.")
      .def(
          "commit", [](Output& self) { run_alone(self, &OutputFile::commit); },
          "Calls finish() if needed, then renames the file to its target.")
      .def(
          "discard", [](Output& self) { run_alone(self, &OutputFile::discard); },
          "Removes what was not committed.");
}

}  // namespace arapfields::python
