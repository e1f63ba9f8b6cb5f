// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <mutex>
#include <string>

namespace arapfields {

/// What a caller holds while a long call runs: it may cancel, and it may read progress, from any thread.
class Task {
 public:
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  /// In [0,1], never decreasing.
  double progress() const { return progress_.load(std::memory_order_relaxed); }
  std::string message() const;
  void report(double fraction, const std::string& message);

 private:
  std::atomic<bool> cancelled_{false};
  std::atomic<double> progress_{0.0};
  mutable std::mutex mutex_;
  std::string message_;
};

/// A stage's share of a Task's progress; what native functions take. Without a Task it does nothing.
/// Call check() at least every 50 ms of work so that a cancel takes effect within 0.2 s.
class Progress {
 public:
  Progress() = default;
  explicit Progress(Task* task, double begin = 0.0, double end = 1.0)
      : task_(task), begin_(begin), end_(end) {}

  /// The part of this stage between two fractions of it.
  Progress part(double from, double to) const;
  /// Reports a fraction of this stage as done; throws Cancelled if the task was cancelled.
  void report(double fraction, const std::string& message = {}) const;
  /// Throws Cancelled if the task was cancelled.
  void check() const;
  /// For loops on worker threads, which must not throw: they leave early and the caller then check()s.
  bool cancelled() const { return task_ != nullptr && task_->cancelled(); }

 private:
  Task* task_ = nullptr;
  double begin_ = 0.0;
  double end_ = 1.0;
};

}  // namespace arapfields
