// SPDX-License-Identifier: GPL-3.0-or-later
// Reports: arapfields/reports.py has a frozen class for each kind.
#pragma once

#include "bindings/bind.h"
#include "optimize/iteration.h"
#include "optimize/loop_result.h"

namespace arapfields::python {

/// An object of the class `kind` with these fields.
py::object make_report(const char* kind, const py::dict& fields);
/// As Python names it.
const char* name_of(StopReason reason);

/// Keeps a report on a field, a signed distance or samples.
void attach_report(const py::object& self, const py::object& report);
/// What was attached, or None; report_of raises AttributeError instead.
py::object report_or_none(const py::object& self);
py::object report_of(const py::object& self);

/// Tells a Python function of each iteration, with an arapfields.Iteration: StopIteration ends the loop,
/// anything else that it raises comes through. None: no observer.
IterationObserver as_observer(const py::object& callback);

}  // namespace arapfields::python
