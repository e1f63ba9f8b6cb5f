// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cfenv>
#include <chrono>
#include <exception>
#include <thread>
#include <utility>

#include "core/errors.h"
#include "core/task.h"

#ifdef __linux__
#include <sys/resource.h>
#endif
#ifdef _WIN32
#include <windows.h>
#else
#include <pthread.h>
#endif

namespace arapfields {
namespace {

using Clock = std::chrono::steady_clock;

/// How long a waiting thread spins before it sleeps: about as long as falling asleep and waking up take.
constexpr std::chrono::microseconds spin_time{20};

void pause_processor() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

/// Spins until ready() or until the time is over; returns ready().
template <class Ready>
bool spin_until(const Ready& ready) {
  const Clock::time_point end = Clock::now() + spin_time;
  do {
    for (int i = 0; i < 16; ++i) {
      if (ready()) return true;
      pause_processor();
    }
  } while (Clock::now() < end);
  return ready();
}

/// As debuggers and monitors show it.
void name_thread() {
#if defined(__linux__)
  pthread_setname_np(pthread_self(), "arapfields");
#elif defined(__APPLE__)
  pthread_setname_np("arapfields");
#elif defined(_WIN32)
  using Describe = HRESULT(WINAPI*)(HANDLE, const wchar_t*);  // of Windows 10 and later
  const auto address = GetProcAddress(GetModuleHandleW(L"kernel32.dll"), "SetThreadDescription");
  if (const auto describe = reinterpret_cast<Describe>(reinterpret_cast<void*>(address)))
    describe(GetCurrentThread(), L"arapfields");
#endif
}

}  // namespace

struct ThreadPool::Job {
  const std::function<void(int)>* work;
  std::fenv_t arithmetic;      // the caller's: on Windows, threads of mingw's round exp() to other digits
  int helpers;                 // under the pool's mutex
  int begun = 0;               // under the pool's mutex
  std::atomic<int> inside{0};  // helpers that have begun and not ended
  std::mutex ending;
  std::condition_variable ended;

  /// Not std::atomic::wait(): without futexes, as on Windows, libstdc++ 12 compares before it locks, and a
  /// notification in between is lost.
  void wait() {
    std::unique_lock lock(ending);
    ended.wait(lock, [this] { return inside.load(std::memory_order_acquire) == 0; });
  }

  void leave() {
    if (inside.fetch_sub(1, std::memory_order_acq_rel) > 1) return;
    {
      const std::lock_guard lock(ending);
    }  // a waiting thread sleeps by now, and is notified
    ended.notify_all();
  }
};

void ThreadPool::run(int helpers, const std::function<void(int)>& work) {
  if (helpers <= 0) return work(0);
  const auto job = std::make_shared<Job>();
  job->work = &work;
  std::fegetenv(&job->arithmetic);
  job->helpers = helpers;
  bool wake = false;
  {
    const std::lock_guard lock(mutex_);
    open_.push_back(job);
    wanted_ += helpers;
    count_open();
    start_threads();
    wake = sleeping_ > 0 && spinning_.load(std::memory_order_relaxed) < helpers;
  }
  if (wake) wake_.notify_one();  // each woken thread wakes the next one
  work(0);
  {
    const std::lock_guard lock(mutex_);
    wanted_ -= helpers;
    std::erase(open_, job);
    count_open();
  }
  const auto ended = [&] { return job->inside.load(std::memory_order_acquire) == 0; };
  if (!spin_until(ended)) job->wait();
}

/// As many as the calls that run now ask for together.
void ThreadPool::start_threads() {
  while (!refused_ && threads_ < std::min(wanted_, most_workers)) {
    try {
      std::thread([this] { serve(); }).detach();
      ++threads_;
    } catch (const std::exception&) {
      refused_ = true;  // the existing threads share the work
    }
  }
}

bool ThreadPool::spin_for_job() const {
  return spin_until([this] { return open_count_.load(std::memory_order_relaxed) > 0; });
}

void ThreadPool::count_open() {
  open_count_.store(static_cast<int>(open_.size()), std::memory_order_relaxed);
}

void ThreadPool::take_job(std::shared_ptr<Job>& job, int& number) {
  std::unique_lock lock(mutex_);
  while (open_.empty()) {
    ++spinning_;
    lock.unlock();
    const bool seen = spin_for_job();
    lock.lock();
    --spinning_;
    if (seen || !open_.empty()) continue;
    ++sleeping_;
    wake_.wait(lock);
    --sleeping_;
  }
  job = open_.front();
  job->inside.fetch_add(1, std::memory_order_relaxed);
  number = ++job->begun;
  if (number == job->helpers) {
    open_.erase(open_.begin());
    count_open();
  }
  const bool wake = !open_.empty() && sleeping_ > 0 && spinning_.load(std::memory_order_relaxed) == 0;
  lock.unlock();
  if (wake) wake_.notify_one();
}

void ThreadPool::serve() {
  name_thread();
  {
    const std::lock_guard lock(starting_);
    on_start_();
  }
  for (;;) {
    std::shared_ptr<Job> job;
    int number = 0;
    take_job(job, number);
    std::fesetenv(&job->arithmetic);
    (*job->work)(number);
    job->leave();
  }
}

namespace {

/// One pool for each priority from −20 to 19, made when first asked for.
std::array<std::atomic<ThreadPool*>, 40> pools{};

std::size_t priority() {
#if defined(__linux__)
  return static_cast<std::size_t>(std::clamp(getpriority(PRIO_PROCESS, 0) + 20, 0, 39));
#else  // threads of macOS and Windows inherit nothing of the kind
  return 20;
#endif
}

#ifndef _WIN32  // which has no fork()
/// After fork() a child has the memory of its parent's pools but not their threads: it drops them.
void forget_pools() {
  for (auto& pool : pools) pool.store(nullptr, std::memory_order_relaxed);
}

[[maybe_unused]] const int watching_forks = pthread_atfork(nullptr, nullptr, forget_pools);
#endif

}  // namespace

ThreadPool& thread_pool() {
  std::atomic<ThreadPool*>& mine = pools[priority()];
  ThreadPool* pool = mine.load(std::memory_order_acquire);
  if (pool != nullptr) return *pool;
  auto* const fresh = new ThreadPool(keep_library_serial);
  if (mine.compare_exchange_strong(pool, fresh, std::memory_order_acq_rel)) return *fresh;
  return *pool;  // another thread was faster; this pool has no threads yet and is dropped
}

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
