// SPDX-License-Identifier: GPL-3.0-or-later
#ifndef _WIN32
#include <sys/wait.h>
#include <unistd.h>
#endif

#include <atomic>
#include <boost/test/unit_test.hpp>
#include <cfenv>
#include <chrono>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/thread_pool.h"

using namespace arapfields;

namespace {

constexpr auto patience = std::chrono::seconds(60);

/// Waits for a condition that other threads bring about; whether it came.
template <class Condition>
bool comes(const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::yield();
  }
  return true;
}

/// Whether `threads` bodies of one loop come to run at the same time, and no more do.
bool meet(int threads, int jobs) {
  const ThreadScope scope(threads);
  std::atomic<int> inside{0}, most{0};
  std::atomic<bool> met{false};
  parallel_jobs(jobs, [&](Index) {
    const int now = ++inside;
    for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
    }
    if (now == threads) met = true;
    comes([&] { return met.load(); });
    --inside;
  });
  return met && most == threads;
}

#ifndef _WIN32
/// The exit status of a child process that runs `body`; −1 where it hangs.
template <class Body>
int in_child(const Body& body) {
  const pid_t child = fork();
  if (child == 0) _exit(body() ? 0 : 1);
  int status = 0;
  if (comes([&] { return waitpid(child, &status, WNOHANG) == child; })) return WEXITSTATUS(status);
  kill(child, SIGKILL);
  waitpid(child, &status, 0);
  return -1;
}
#endif

Index sum_of_chunks(Index count) {
  std::atomic<Index> sum{0};
  parallel_for(0, count, 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) sum += i;
  });
  return sum;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(threads)

BOOST_AUTO_TEST_CASE(a_loop_runs_on_as_many_threads_as_its_scope_says) {
  for (const int count : {1, 2, 3, 8}) BOOST_CHECK(meet(count, 4 * count));
}

BOOST_AUTO_TEST_CASE(a_loop_covers_its_range_once) {
  for (const int threads : {1, 2, 5})
    for (const Index length : {0, 1, 7, 128, 129, 10007}) {
      const ThreadScope scope(threads);
      std::vector<int> seen(static_cast<std::size_t>(length), 0);
      parallel_for(3, 3 + length, 4, [&](Index begin, Index end) {
        for (Index i = begin; i < end; ++i) ++seen[static_cast<std::size_t>(i - 3)];
      });
      BOOST_CHECK(std::all_of(seen.begin(), seen.end(), [](int n) { return n == 1; }));
    }
}

BOOST_AUTO_TEST_CASE(chunks_do_not_depend_on_the_number_of_threads) {
  const auto chunks = [](int threads) {
    const ThreadScope scope(threads);
    std::mutex mutex;
    std::set<std::pair<Index, Index>> found;
    parallel_for(0, 100003, 16, [&](Index begin, Index end) {
      const std::lock_guard lock(mutex);
      found.emplace(begin, end);
    });
    return found;
  };
  const auto alone = chunks(1);
  BOOST_CHECK_GT(alone.size(), 16u);
  BOOST_CHECK(chunks(2) == alone && chunks(7) == alone);
}

BOOST_AUTO_TEST_CASE(all_threads_round_as_the_caller_does) {
  const ThreadScope scope(3);
  const int before = std::fegetround();
  std::atomic<int> different{0};
  std::fesetround(FE_UPWARD);
  parallel_jobs(2000, [&](Index) {
    if (std::fegetround() != FE_UPWARD) ++different;
    std::this_thread::sleep_for(std::chrono::microseconds(10));
  });
  std::fesetround(before);
  BOOST_TEST(different == 0);
}

BOOST_AUTO_TEST_CASE(slots_are_one_thread_s_at_a_time) {
  const ThreadScope scope(4);
  std::array<std::atomic<int>, 4> users{};
  std::atomic<bool> clash{false};
  parallel_jobs_in_slots(1000, [&](Index, Index slot) {
    if (users.at(static_cast<std::size_t>(slot))++ != 0) clash = true;
    std::this_thread::yield();
    --users.at(static_cast<std::size_t>(slot));
  });
  BOOST_CHECK(!clash);
}

BOOST_AUTO_TEST_CASE(loops_within_loops_stay_on_their_thread) {
  const ThreadScope scope(4);
  std::atomic<int> strayed{0}, done{0};
  parallel_jobs(16, [&](Index) {
    const ThreadScope more(8);
    if (thread_count() != 1) ++strayed;
    const auto here = std::this_thread::get_id();
    parallel_for(0, 100, 1, [&](Index begin, Index end) {
      done += static_cast<int>(end - begin);
      if (std::this_thread::get_id() != here) ++strayed;
    });
  });
  BOOST_CHECK_EQUAL(strayed, 0);
  BOOST_CHECK_EQUAL(done, 1600);
  BOOST_CHECK_EQUAL(thread_count(), 4);
}

BOOST_AUTO_TEST_CASE(an_exception_reaches_the_caller_and_ends_the_loop) {
  for (const int threads : {1, 4}) {
    const ThreadScope scope(threads);
    for (int round = 0; round < 50; ++round) {
      std::atomic<int> begun{0};
      const auto loop = [&] {
        parallel_jobs(100000, [&](Index job) {
          ++begun;
          if (job == 5) throw InvalidInput("found by a worker");
          if (job > 5) std::this_thread::sleep_for(std::chrono::microseconds(10));  // throwing takes longer
        });
      };
      BOOST_CHECK_THROW(loop(), InvalidInput);
      BOOST_CHECK_LT(begun, 100000);
    }
    BOOST_CHECK_EQUAL(sum_of_chunks(1000), 499500);
    BOOST_CHECK_EQUAL(thread_count(), threads);
  }
}

BOOST_AUTO_TEST_CASE(calls_at_once_keep_to_their_own_number_of_threads) {
  const int before = thread_count();
  std::atomic<bool> fine{true};
  std::vector<std::thread> callers;
  for (const int count : {1, 2, 3})
    callers.emplace_back([&, count] {
      for (int round = 0; round < 20; ++round)
        if (!meet(count, 2 * count)) fine = false;
    });
  for (std::thread& caller : callers) caller.join();
  BOOST_CHECK(fine);
  BOOST_CHECK_EQUAL(thread_count(), before);
  int elsewhere = 0;
  std::thread([&] { elsewhere = thread_count(); }).join();
  BOOST_CHECK_EQUAL(elsewhere, before);
}

BOOST_AUTO_TEST_CASE(a_call_ends_whenever_its_helper_does) {
  using Clock = std::chrono::steady_clock;
  for (int round = 0; round < 1000; ++round) {
    std::atomic<bool> begun{false};
    thread_pool().run(1, [&](int number) {
      if (number == 0) {
        comes([&] { return begun.load(); });
        return;  // falls asleep some 20 µs later, about when the helper ends
      }
      begun = true;
      const Clock::time_point end = Clock::now() + std::chrono::microseconds(15 + round % 20);
      while (Clock::now() < end) {
      }
    });
    BOOST_REQUIRE(begun);
  }
}

BOOST_AUTO_TEST_CASE(more_threads_than_the_pool_has_are_done_without) {
  const ThreadScope scope(1024);
  BOOST_CHECK_EQUAL(thread_count(), ThreadPool::most_workers + 1);
  BOOST_CHECK_EQUAL(sum_of_chunks(100000), 4999950000);
}

#ifndef _WIN32  // which has no fork()
BOOST_AUTO_TEST_CASE(a_forked_child_works, *boost::unit_test::label("fork")) {
  BOOST_CHECK(meet(3, 6));
  BOOST_CHECK_EQUAL(in_child([] { return meet(3, 6) && sum_of_chunks(1000) == 499500; }), 0);
  BOOST_CHECK(meet(3, 6));
}

BOOST_AUTO_TEST_CASE(a_child_forked_during_another_thread_s_loop_works, *boost::unit_test::label("fork")) {
  std::atomic<bool> begun{false}, over{false};
  std::thread busy([&] {
    const ThreadScope scope(3);
    while (!over) begun = sum_of_chunks(10000) > 0;
  });
  BOOST_REQUIRE(comes([&] { return begun.load(); }));
  for (int round = 0; round < 10; ++round) BOOST_CHECK_EQUAL(in_child([] { return meet(2, 4); }), 0);
  over = true;
  busy.join();
}
#endif

BOOST_AUTO_TEST_CASE(libtorch_s_own_number_of_threads_comes_back) {
  const int before = library_threads();
  {
    const ThreadScope outer(3), inner(2);
    BOOST_CHECK_EQUAL(thread_count(), 2);
    BOOST_CHECK_EQUAL(library_threads(), 1);
    std::atomic<bool> serial{true};
    parallel_jobs(64, [&](Index) {
      if (library_threads() != 1) serial = false;
    });
    BOOST_CHECK(serial);
  }
  BOOST_CHECK_EQUAL(library_threads(), before);
}

BOOST_AUTO_TEST_SUITE_END()
