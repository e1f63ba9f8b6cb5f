// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace arapfields {

/// Threads that wait for work, started when first needed and kept. One that finds no work spins for some
/// microseconds and then sleeps. Every call has its own number of threads; calls may overlap.
class ThreadPool {
 public:
  /// At most this many threads beside the callers'.
  static constexpr int most_workers = 255;

  /// Every thread runs `on_start` first.
  explicit ThreadPool(std::function<void()> on_start) : on_start_(std::move(on_start)) {}
  ~ThreadPool() = delete;  // a pool lives as long as the process, so that no thread waits for it at exit
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  /// Runs work(0) on the calling thread and, beside it, work(1) to at most work(helpers), one a thread, as
  /// threads come; returns when each that was begun has ended. What has not begun when work(0) ends is
  /// skipped: a thread that starts late, or that the system refuses to start, delays no call. `work` must not
  /// throw.
  void run(int helpers, const std::function<void(int)>& work);

 private:
  struct Job;

  void start_threads();
  void serve();
  bool spin_for_job() const;
  void take_job(std::shared_ptr<Job>& job, int& number);
  void count_open();

  const std::function<void()> on_start_;
  /// One thread starts at a time: in a forked child a library may make its own pool anew, unguarded.
  std::mutex starting_;
  std::mutex mutex_;  // guards what follows, of which the atomic ones are read without it too
  std::condition_variable wake_;
  std::vector<std::shared_ptr<Job>> open_;  // jobs that want more threads, oldest first
  std::atomic<int> open_count_{0}, spinning_{0};
  int sleeping_ = 0, threads_ = 0, wanted_ = 0;
  bool refused_ = false;
};

/// The pool of the calling thread's scheduling priority (on Linux threads have one each, and inherit it):
/// work for a thread of low priority is done at low priority. After fork() the child's first call makes it
/// new ones.
ThreadPool& thread_pool();

}  // namespace arapfields
