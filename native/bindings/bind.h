// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <chrono>
#include <optional>
#include <thread>
#include <type_traits>

#include "core/errors.h"
#include "core/task.h"
#include "core/types.h"

// What every bind_<folder>.cpp shares.

namespace arapfields::python {

namespace py = pybind11;

/// Ctrl-C during a native call. Where Python's main thread makes the call, signal handlers run about every
/// 50 ms. The exception that a handler raises ends the call.
class SignalWatch {
 public:
  SignalWatch();  ///< with the GIL
  /// Without it, on any thread.
  Progress::Interruption interruption() {
    return [this] { return look(); };
  }
  /// With the GIL: throws what a handler raised, if any did.
  void rethrow() const {
    if (raised_) throw py::error_already_set(*raised_);
  }

 private:
  bool look();

  bool main_thread_;
  std::thread::id thread_ = std::this_thread::get_id();
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  std::optional<py::error_already_set> raised_;
};

/// Runs a long native call without the GIL. `task` is None or a Task.
template <class Call>
auto run_long(Task* task, Call&& call) {
  Task unwatched;
  SignalWatch signals;
  const Progress::Interruption interruption = signals.interruption();
  const auto released = [&] {
    const py::gil_scoped_release release;
    return call(Progress(task != nullptr ? task : &unwatched, 0.0, 1.0, &interruption));
  };
  try {
    if constexpr (std::is_void_v<decltype(released())>) {
      released();
      signals.rethrow();
    } else {
      auto result = released();
      signals.rethrow();  // it may have come too late to be seen by the call
      return result;
    }
  } catch (const Cancelled&) {
    signals.rethrow();
    throw;
  }
}

/// The same for a call that reports no progress: call().
template <class Call>
auto run_long(Call&& call) {
  return run_long(nullptr, [&](const Progress&) { return call(); });
}

namespace py = pybind11;
using namespace pybind11::literals;

/// A member function of which None as the object is refused: pybind11 alone would take a null pointer.
template <class Class, class Return, class... Args>
auto method(Return (Class::*function)(Args...)) {
  return [function](Class& self, Args... args) -> Return {
    return (self.*function)(std::forward<Args>(args)...);
  };
}
template <class Class, class Return, class... Args>
auto method(Return (Class::*function)(Args...) const) {
  return [function](const Class& self, Args... args) -> Return {
    return (self.*function)(std::forward<Args>(args)...);
  };
}

/// Raises Python's Diverged with the state that was kept as its attribute `last_good`.
[[noreturn]] void raise_diverged(const Diverged& error, const py::object& last_good);

/// Has NumPy's functions, where they ask for the lock of an interpreter that has ended, stop their thread as
/// this module's other calls of Python do; on Linux.
#if defined(__linux__)
void stop_in_numpy();
#else
inline void stop_in_numpy() {}
#endif

void bind_core(py::module_& module);
void bind_options(py::module_& module);
void bind_mesh(py::module_& module);
void bind_distance(py::module_& module);
void bind_implicit(py::module_& module);
void bind_neural(py::module_& module);
void bind_mesh_sdf(py::module_& module);
void bind_sampling(py::module_& module);
void bind_fit(py::module_& module);
void bind_fields(py::module_& module);
void bind_energies(py::module_& module);
void bind_object_style(py::module_& module);
void bind_solve(py::module_& module);
void bind_wrap(py::module_& module);
void bind_extraction(py::module_& module);
void bind_radial(py::module_& module);
void bind_attach(py::module_& module);
void bind_curve(py::module_& module);
void bind_sharpen(py::module_& module);
void bind_skin(py::module_& module);
void bind_splats(py::module_& module);
void bind_contact(py::module_& module);
void bind_solve_testing(py::module_& module);
void bind_invertible_testing(py::module_& module);

}  // namespace arapfields::python
