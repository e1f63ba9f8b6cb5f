// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <utility>

#include "core/errors.h"
#include "core/task.h"
#include "core/thread_pool.h"

namespace arapfields {
namespace {

/// Chunks that a loop is split into at the most: enough for many threads to share them evenly.
constexpr Index most_chunks = 128;

thread_local int scope_threads = 0;              // 0 outside of every ThreadScope
thread_local bool in_loop_body = false;          // in which further loops are not split
thread_local const Progress* checked = nullptr;  // by the loops in a CancelScope

/// The first exception of some threads, and whether there is one.
class FirstError {
 public:
  bool any() const { return any_.load(std::memory_order_relaxed); }
  void keep() {
    if (!any_.exchange(true)) error_ = std::current_exception();
  }
  /// Once the threads have ended.
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::atomic<bool> any_{false};
  std::exception_ptr error_;
};

}  // namespace

void parallel_jobs_in_slots(Index count, const std::function<void(Index, Index)>& body) {
  if (count <= 0) return;
  const ThreadScope scope;
  const auto threads = static_cast<int>(std::min<Index>(count, thread_count()));
  const bool nested = in_loop_body;
  std::atomic<Index> next{0};
  FirstError error;
  const auto work = [&](int slot) {
    in_loop_body = true;
    for (Index job = next++; job < count && !error.any(); job = next++) {
      try {
        if (slot == 0 && checked) checked->check();  // slot 0 is the calling thread
        body(job, slot);
      } catch (...) {
        error.keep();
      }
    }
  };
  if (threads == 1)
    work(0);
  else
    thread_pool().run(threads - 1, work);
  in_loop_body = nested;
  error.rethrow();
}

void parallel_jobs(Index count, const std::function<void(Index)>& body) {
  parallel_jobs_in_slots(count, [&](Index job, Index) { body(job); });
}

void parallel_for(Index begin, Index end, Index grain, const std::function<void(Index, Index)>& body) {
  if (begin >= end) return;
  const Index length = end - begin, least = std::max<Index>(grain, 1);
  const Index chunk = std::max(least, (length + most_chunks - 1) / most_chunks);
  parallel_jobs((length + chunk - 1) / chunk,
                [&](Index job) { body(begin + job * chunk, std::min(end, begin + (job + 1) * chunk)); });
}

ThreadScope::ThreadScope(int threads) : before_(scope_threads) {
  require_range("threads", threads, 0, 1024);
  if (before_ > 0 && threads == 0) return;
  scope_threads = std::min(threads > 0 ? threads : library_threads(), ThreadPool::most_workers + 1);
  if (before_ == 0 && !in_loop_body) serial_.emplace();
}

ThreadScope::~ThreadScope() { scope_threads = before_; }

CancelScope::CancelScope(const Progress& progress) : before_(std::exchange(checked, &progress)) {}

CancelScope::~CancelScope() { checked = before_; }

int thread_count() {
  if (in_loop_body) return 1;
  return scope_threads > 0 ? scope_threads : std::min(library_threads(), ThreadPool::most_workers + 1);
}

}  // namespace arapfields
