// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/thread_pool.h"

#include <algorithm>
#include <array>
#include <cfenv>
#include <chrono>
#include <exception>
#include <thread>

#ifdef __linux__
#include <sys/resource.h>
#endif
#ifdef _WIN32
#include <windows.h>
#else
#include <pthread.h>
#endif

#include "core/library_threads.h"

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

}  // namespace arapfields
