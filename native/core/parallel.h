// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "core/types.h"

namespace arapfields {

// The threads of the library that does our products; defined by the tensors' backend.

/// Threads for the calling thread's loops where nothing else is said: OMP_NUM_THREADS or what the
/// library was told, else the processor's cores. Must not be called under a SerialLibrary.
int library_threads();

/// While one lives, the library's functions, those of its BLAS and LAPACK included, stay on the calling
/// thread. The settings used are the thread's own (OpenMP's and MKL's thread-local ones) and come back at the
/// end: nobody else sees a change.
class SerialLibrary {
 public:
  SerialLibrary();
  ~SerialLibrary();
  SerialLibrary(const SerialLibrary&) = delete;
  SerialLibrary& operator=(const SerialLibrary&) = delete;

 private:
  int openmp_, mkl_;
};

/// The same for the rest of the calling thread's life.
void keep_library_serial();

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

class Progress;

/// Splits [begin, end) into chunks of at least `grain` and runs body(chunk_begin, chunk_end) for each on the
/// call's threads (ThreadScope), which take the next chunk as they come free. The chunks depend on the range
/// and the grain alone, not on the number of threads. Loops within `body` stay on their thread, as do
/// the tensors' operations. After an exception in `body` no chunk is begun, and the caller gets it (one,
/// where there are more).
ARAPFIELDS_EXPORT void parallel_for(Index begin, Index end, Index grain,
                                    const std::function<void(Index, Index)>& body);

/// The same for jobs 0 to count−1, one by one: for jobs of unequal length.
ARAPFIELDS_EXPORT void parallel_jobs(Index count, const std::function<void(Index)>& body);
/// body(job, slot): jobs that run at the same time have different slots, which are below thread_count().
ARAPFIELDS_EXPORT void parallel_jobs_in_slots(Index count, const std::function<void(Index, Index)>& body);

/// Gives the calling thread's loops a number of threads while it lives, and keeps the tensors' library
/// serial; 0 keeps the number that is in force. No other thread and no later call sees any of it. More
/// threads than the pool may have (256), or than the system grants, are done without: results do not depend
/// on their number.
class ARAPFIELDS_EXPORT ThreadScope {
 public:
  explicit ThreadScope(int threads = 0);
  ~ThreadScope();
  ThreadScope(const ThreadScope&) = delete;
  ThreadScope& operator=(const ThreadScope&) = delete;

 private:
  int before_;
  std::optional<SerialLibrary> serial_;
};

/// While it lives, the calling thread's loops end with Cancelled once the task of `progress` is cancelled.
/// What they write is then incomplete: for work whose result is thrown away. `progress` must outlive it.
class ARAPFIELDS_EXPORT CancelScope {
 public:
  explicit CancelScope(const Progress& progress);
  ~CancelScope();
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

 private:
  const Progress* before_;
};

/// The threads that a loop here would be split over: those of the innermost ThreadScope, else as many as
/// library_threads() says; 1 within a loop's body.
ARAPFIELDS_EXPORT int thread_count();

}  // namespace arapfields
