// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "core/types.h"

namespace arapfields {

/// Handle on a long call: any thread may cancel it and read its progress.
class ARAPFIELDS_EXPORT Task {
 public:
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  /// In [0,1], never decreasing.
  double progress() const { return progress_.load(std::memory_order_relaxed); }
  std::string message() const;
  void report(double fraction, const std::string& message);

  /// Requests previews of a solve: the positions of these points under the field reached so far, as soon as
  /// there is one and then about every `seconds`. Must be called before the solve begins. Previews take at
  /// most a third of the solve's time.
  void watch(PointsIn points, double seconds);
  /// Number of previews so far, and the points' positions (n,3) in the latest; (0, 3) before the first.
  Index previews() const;
  PointsF watched() const;

 private:
  friend class Progress;
  using Clock = std::chrono::steady_clock;

  std::atomic<bool> cancelled_{false};
  std::atomic<double> progress_{0.0};
  mutable std::mutex mutex_;
  std::string message_;
  Points watched_points_;
  PointsF preview_;
  Index previews_ = 0;
  double pause_ = 0.0;
  Clock::time_point next_preview_;
};

/// The part of a Task's progress that belongs to one stage. Native functions take it; without a Task it does
/// nothing.
/// Call check() at least every 50 ms of work so that a cancel takes effect within 0.2 s.
class ARAPFIELDS_EXPORT Progress {
 public:
  /// Called at each check of the task, on the checking thread: true cancels the task.
  using Interruption = std::function<bool()>;

  Progress() = default;
  /// `interruption` (may be null) must outlive all copies. It needs a task to cancel.
  explicit Progress(Task* task, double begin = 0.0, double end = 1.0,
                    const Interruption* interruption = nullptr)
      : task_(task), begin_(begin), end_(end), interruption_(interruption) {}

  /// The part of this stage between two fractions of it.
  Progress part(double from, double to) const;
  /// Reports a fraction of this stage as done; throws Cancelled if the task was cancelled.
  void report(double fraction, const std::string& message = {}) const;
  /// Throws Cancelled if the task was cancelled.
  void check() const;
  /// Makes a preview where one is due: `evaluate` maps the watched points to their current positions.
  void preview(const std::function<Points(PointsIn)>& evaluate) const;
  /// For loops on worker threads, which must not throw: they leave early and the caller then check()s.
  bool cancelled() const;

 private:
  Task* task_ = nullptr;
  double begin_ = 0.0;
  double end_ = 1.0;
  const Interruption* interruption_ = nullptr;
};

/// Seconds since it was made.
class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// An object that one thread at a time works on: another waits until the object is as the call before left
/// it.
template <class T>
class OneAtATime {
 public:
  template <class... Given>
  explicit OneAtATime(Given&&... given) : object_(std::forward<Given>(given)...) {}

  /// call(object). While it waits, `progress` may cancel. Throws where this very thread is at work on the
  /// object: a signal handler, which would wait for itself.
  template <class Call>
  auto run(const Progress& progress, Call&& call) {
    constexpr auto look = std::chrono::milliseconds(20);
    if (worker_ == std::this_thread::get_id())
      throw std::runtime_error("the object is at work on this thread, and cannot be asked before it ends");
    std::unique_lock lock(mutex_, std::defer_lock);
    // Not try_lock_for(): it locks by a call that GCC's thread sanitizer does not know.
    while (!lock.try_lock_until(std::chrono::system_clock::now() + look)) progress.check();
    const Working working(worker_);
    return call(object_);
  }

 private:
  struct Working {
    explicit Working(std::atomic<std::thread::id>& at) : worker(at) { worker = std::this_thread::get_id(); }
    ~Working() { worker = std::thread::id(); }
    std::atomic<std::thread::id>& worker;
  };

  T object_;
  std::timed_mutex mutex_;
  std::atomic<std::thread::id> worker_;
};

}  // namespace arapfields
