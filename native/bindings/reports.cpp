// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/reports.h"

#include <pybind11/stl.h>

#include "bindings/arrays.h"

namespace arapfields::python {

py::dict field_measures(const ArapValue& arap, const Distortion& distortion) {
  return py::dict("stretch"_a = arap.stretch, "bend"_a = arap.bend,
                  "min_determinant"_a = distortion.min_determinant,
                  "flipped_share"_a = distortion.flipped_share);
}

py::dict terms_of(const std::vector<LossTerm>& terms) {
  py::dict result;
  for (const LossTerm& term : terms) result[py::str(term.name)] = term.value;
  return result;
}

py::object contact_report(const ContactReport& contact) {
  py::list held;
  for (const HeldBack& h : contact.held)
    held.append(make_report("HeldBack", "handle"_a = h.handle, "by"_a = h.by, "distance"_a = h.distance));
  return make_report("ContactReport", "deepest"_a = contact.deepest, "touching"_a = contact.touching,
                     "held"_a = py::tuple(held), "crossing"_a = py::tuple(py::cast(contact.crossing)),
                     "self_intersections"_a = contact.self_intersections);
}

const char* name_of(StopReason reason) {
  switch (reason) {
    case StopReason::time_budget:
      return "time_budget";
    case StopReason::target:
      return "target_error";
    case StopReason::observer:
      return "callback";
    case StopReason::divergence:
      return "diverged";
    case StopReason::iterations:
      break;
  }
  return "iterations";
}

void attach_report(const py::object& self, const py::object& report) { self.attr("_report") = report; }

py::object report_or_none(const py::object& self) { return py::getattr(self, "_report", py::none()); }

py::object report_of(const py::object& self) {
  py::object report = report_or_none(self);
  if (report.is_none())
    throw py::attribute_error("report: this " + py::cast<std::string>(py::type::of(self).attr("__name__")) +
                              " has none; what a fit, a solve or sample_surface returns has one");
  return report;
}

IterationObserver as_observer(const py::object& callback) {
  if (callback.is_none()) return {};
  require(PyCallable_Check(callback.ptr()) != 0, "callback", "got " + type_text(callback),
          "a function of an Iteration is needed");
  const std::shared_ptr<py::object> held = kept_alive(callback);
  return [held](const Iteration& iteration) {
    const py::gil_scoped_acquire acquire;
    try {
      (*held)(make_report("Iteration", "iteration"_a = iteration.number, "loss"_a = iteration.loss,
                          "terms"_a = terms_of(iteration.terms), "seconds"_a = iteration.seconds));
    } catch (const py::error_already_set& raised) {
      if (!raised.matches(PyExc_StopIteration)) throw;
      return false;
    }
    return true;
  };
}

}  // namespace arapfields::python
