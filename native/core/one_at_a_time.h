// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "core/task.h"

namespace arapfields {

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
