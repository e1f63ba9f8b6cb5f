// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <string>

#include "core/types.h"

namespace arapfields {

/// What a caller holds while a long call runs: it may cancel, and it may read progress, from any thread.
class ARAPFIELDS_EXPORT Task {
 public:
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  /// In [0,1], never decreasing.
  double progress() const { return progress_.load(std::memory_order_relaxed); }
  std::string message() const;
  void report(double fraction, const std::string& message);

  /// Asks the running call to say where its present field takes these points, as soon as it has one and then
  /// about every `seconds`. Called before the call begins. Looks take a third of the call's time at most.
  void watch(PointsIn points, double seconds);
  /// How often that was done, and where the points (n,3) were at the last time; (0, 3) at first.
  Index looks() const;
  PointsF watched() const;

 private:
  friend class Progress;
  using Clock = std::chrono::steady_clock;

  std::atomic<bool> cancelled_{false};
  std::atomic<double> progress_{0.0};
  mutable std::mutex mutex_;
  std::string message_;
  Points watch_;
  PointsF watched_;
  Index looks_ = 0;
  double pause_ = 0.0;
  Clock::time_point next_look_;
};

/// A stage's share of a Task's progress; what native functions take. Without a Task it does nothing.
/// Call check() at least every 50 ms of work so that a cancel takes effect within 0.2 s.
class ARAPFIELDS_EXPORT Progress {
 public:
  /// Asked at each look at the task, on the thread that looks: true cancels the task.
  using Interruption = std::function<bool()>;

  Progress() = default;
  /// What `interruption` points to (null: nothing) must outlive all copies; it needs a task to cancel.
  explicit Progress(Task* task, double begin = 0.0, double end = 1.0,
                    const Interruption* interruption = nullptr)
      : task_(task), begin_(begin), end_(end), interruption_(interruption) {}

  /// The part of this stage between two fractions of it.
  Progress part(double from, double to) const;
  /// Reports a fraction of this stage as done; throws Cancelled if the task was cancelled.
  void report(double fraction, const std::string& message = {}) const;
  /// Throws Cancelled if the task was cancelled.
  void check() const;
  /// For whoever watches: where a look is due, asks `where` for the watched points' present places.
  void look(const std::function<Points(PointsIn)>& where) const;
  /// For loops on worker threads, which must not throw: they leave early and the caller then check()s.
  bool cancelled() const;

 private:
  Task* task_ = nullptr;
  double begin_ = 0.0;
  double end_ = 1.0;
  const Interruption* interruption_ = nullptr;
};

}  // namespace arapfields
