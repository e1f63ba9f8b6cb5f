// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/run_long.h"

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

}  // namespace arapfields::python
