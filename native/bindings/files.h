// SPDX-License-Identifier: GPL-3.0-or-later
// Python's side of io/: paths, and reports as JSON.
#pragma once

#include "bindings/bind.h"

namespace arapfields::python {

/// What os.fspath() takes, as the bytes that the system takes. InvalidInput for anything else, for the empty
/// path, and for one that holds a NUL.
std::string as_path(const py::object& path);
/// A report (a dict) as JSON text, and back; arrays become lists, NaN and infinities null.
std::string report_text(const py::object& report);
py::dict report_from(const std::string& text);

void bind_io(py::module_& module);

}  // namespace arapfields::python
