// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "core/types.h"

namespace arapfields {

/// Splits [begin, end) into ranges of at least `grain` and runs body(range_begin, range_end) on the threads
/// that libtorch's matrix products use too, so that the two never compete. The split depends on the thread
/// count alone. An exception in `body` reaches the caller.
void parallel_for(Index begin, Index end, Index grain, const std::function<void(Index, Index)>& body);

/// Runs body(job) for jobs 0 to count−1 on the same threads, each taking the next job that is left: for jobs
/// of unequal length whose results do not depend on who runs them.
void parallel_jobs(Index count, const std::function<void(Index)>& body);

/// Sets the calling thread's number of worker threads for its lifetime; 0 keeps what is in force.
class ThreadScope {
 public:
  explicit ThreadScope(int threads);
  ~ThreadScope();
  ThreadScope(const ThreadScope&) = delete;
  ThreadScope& operator=(const ThreadScope&) = delete;

 private:
  int before_;
};

int thread_count();

}  // namespace arapfields
