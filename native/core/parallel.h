// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <optional>

#include "core/library_threads.h"
#include "core/types.h"

namespace arapfields {
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
