// SPDX-License-Identifier: GPL-3.0-or-later
// Python's side of io/: paths, and reports as JSON.
#pragma once

#include "bindings/bind.h"

namespace arapfields::python {

/// What os.fspath() takes, as the bytes that the system takes. InvalidInput for anything else, for the empty
/// path, and for one that holds a NUL.
std::string as_path(const py::object& path);
/// A report, or None, as JSON text, and back; NaN and infinities are null. InvalidInput that begins with the
/// file's name for a text that is no report.
std::string report_text(const py::object& report);
py::object report_from(const std::string& text, const std::string& place);

void bind_io(py::module_& module);

}  // namespace arapfields::python
