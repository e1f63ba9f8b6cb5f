// SPDX-License-Identifier: GPL-3.0-or-later
// Reports: arapfields/reports.py has a frozen class for each kind.
#pragma once

#include "bindings/bind.h"
#include "energies/arap.h"
#include "energies/distortion.h"
#include "optimize/iteration.h"
#include "solve/contact/contact.h"

namespace arapfields::python {

/// A report of the class arapfields.reports.`kind` with keyword fields: make_report("FitReport", "scale"_a
/// = 1.0).
template <class... Fields>
py::object make_report(const char* kind, Fields&&... fields) {
  return py::module_::import("arapfields.reports").attr(kind)(std::forward<Fields>(fields)...);
}
/// The fields that all reports on a field share, for `**` in make_report.
py::dict field_measures(const ArapValue& arap, const Distortion& distortion);
/// {name: weighted value} of terms.
py::dict terms_of(const std::vector<LossTerm>& terms);
/// How a surface touches, as an arapfields.reports.ContactReport.
py::object contact_report(const ContactReport& contact);
/// What a report's `stopped_by` says.
const char* name_of(StopReason reason);

/// Keeps a report on a field, a signed distance or samples.
void attach_report(const py::object& self, const py::object& report);
/// What was attached, or None; report_of raises AttributeError instead.
py::object report_or_none(const py::object& self);
py::object report_of(const py::object& self);

/// Calls a Python function with an arapfields.Iteration after each iteration. StopIteration ends the loop;
/// any other exception propagates. None: no observer.
IterationObserver as_observer(const py::object& callback);

}  // namespace arapfields::python
