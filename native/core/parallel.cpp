// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/parallel.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <atomic>

#include "core/errors.h"

namespace arapfields {

void parallel_for(Index begin, Index end, Index grain, const std::function<void(Index, Index)>& body) {
  at::parallel_for(begin, end, grain, body);
}

void parallel_jobs(Index count, const std::function<void(Index)>& body) {
  std::atomic<Index> next{0};
  parallel_for(0, std::min<Index>(count, thread_count()), 1, [&](Index, Index) {
    for (Index job = next++; job < count; job = next++) body(job);
  });
}

ThreadScope::ThreadScope(int threads) : before_(at::get_num_threads()) {
  require_range("threads", threads, 0, 1024);
  if (threads > 0) at::set_num_threads(threads);
}

ThreadScope::~ThreadScope() {
  if (at::get_num_threads() != before_) at::set_num_threads(before_);
}

int thread_count() { return at::get_num_threads(); }

}  // namespace arapfields
