// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/thread_executor.hpp"

#include <doctest/doctest.h>

#if defined(__linux__)
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <string>
#include <thread>

#include "compmark/testing/executor_laws.hpp"

using namespace compmark;

TEST_CASE("core/thread_executor: obeys E1 to E4") {
  const std::string broken = testing::executor_laws([](std::size_t threads) { return ThreadExecutor(threads); });
  CHECK_MESSAGE(broken.empty(), broken);
}

TEST_CASE("core/thread_executor: threads = 0 takes at least one worker") {
  CHECK(ThreadExecutor(0).concurrency() >= 1);
}

TEST_CASE("core/thread_executor: a nested loop covers its range in place") {
  ThreadExecutor executor(2);
  std::array<std::atomic<int>, 64> visits{};
  executor.for_chunks(8, 1, [&](std::size_t outer, std::size_t, std::size_t) {
    executor.for_chunks(8, 2, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) visits[outer * 8 + i].fetch_add(1);
    });
  });
  for (const std::atomic<int>& visit : visits) CHECK(visit == 1);
}

TEST_CASE("core/thread_executor: ten thousand loops of two chunks end (no lost wake-up)") {
  ThreadExecutor executor(3);
  std::atomic<int> chunks{0};
  for (int loop = 0; loop < 10000; ++loop) {
    executor.for_chunks(2, 1,
                        [&](std::size_t, std::size_t, std::size_t) { chunks.fetch_add(1, std::memory_order_relaxed); });
  }
  CHECK(chunks == 20000);
}

#if defined(__linux__)
namespace {
namespace thread_executor_test {

std::atomic<bool> held{false};
std::atomic<bool> let_go{false};
/// Keeps the thread that gets the signal from running on, as a system without a processor for it does.
void hold(int) {
  held.store(true);
  while (!let_go.load()) ::usleep(1000);
}

}  // namespace thread_executor_test
}  // namespace

TEST_CASE("core/thread_executor: a worker that is not run is not waited for, and not missed") {
  namespace test = thread_executor_test;
  static_assert(std::atomic<bool>::is_always_lock_free);
  ThreadExecutor executor(2);
  REQUIRE(executor.concurrency() == 2);
  // The other worker is who takes a chunk while the caller waits in one.
  std::atomic<bool> came{false};
  pthread_t worker{};
  executor.for_chunks(2, 1, [&](std::size_t, std::size_t, std::size_t id) {
    if (id == 1) {
      worker = ::pthread_self();
      came.store(true);
    }
    while (!came.load()) std::this_thread::yield();
  });
  struct sigaction action {};
  struct sigaction before {};
  action.sa_handler = test::hold;
  REQUIRE(::sigaction(SIGUSR1, &action, &before) == 0);
  test::held.store(false);
  test::let_go.store(false);
  REQUIRE(::pthread_kill(worker, SIGUSR1) == 0);
  while (!test::held.load()) std::this_thread::yield();
  // An executor that waits for every worker ends its loop only when this thread gives up.
  std::atomic<bool> ended{false};
  std::thread watch([&] {
    for (int i = 0; i < 10000 && !ended.load(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    test::let_go.store(true);
  });
  std::atomic<int> chunks{0};
  bool only_the_caller = true;
  for (int loop = 0; loop < 100; ++loop) {
    executor.for_chunks(50, 1, [&](std::size_t, std::size_t, std::size_t id) {
      only_the_caller = only_the_caller && id == 0;
      chunks.fetch_add(1);
    });
  }
  CHECK_FALSE(test::let_go.load());
  CHECK(chunks == 5000);
  CHECK(only_the_caller);
  ended.store(true);
  watch.join();
  // It comes back, and works again.
  came.store(false);
  executor.for_chunks(2, 1, [&](std::size_t, std::size_t, std::size_t id) {
    if (id == 1) came.store(true);
    while (!came.load()) std::this_thread::yield();
  });
  CHECK(came.load());
  REQUIRE(::sigaction(SIGUSR1, &before, nullptr) == 0);
}
#endif

TEST_CASE("core/thread_executor: an exception ends the loop after those who are inside, and the next loop is whole") {
  ThreadExecutor executor(3);
  for (int loop = 0; loop < 300; ++loop) {
    std::atomic<int> inside{0};
    try {
      executor.for_chunks(64, 1, [&](std::size_t begin, std::size_t, std::size_t) {
        inside.fetch_add(1);
        if (begin % 7 == 3) {
          inside.fetch_sub(1);
          throw begin;
        }
        inside.fetch_sub(1);
      });
      FAIL_CHECK("nothing was thrown");
    } catch (std::size_t) {
    }
    CHECK(inside == 0);
    std::atomic<int> chunks{0};
    executor.for_chunks(64, 1, [&](std::size_t, std::size_t, std::size_t) { chunks.fetch_add(1); });
    CHECK(chunks == 64);
  }
}

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define COMPMARK_TEST_SANITIZED 1  // it reserves terabytes
#endif
#endif
#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(COMPMARK_TEST_SANITIZED)
// In a process of its own, whose limits end with it: stacks of 8 MiB, and room for a few of them.
TEST_CASE("core/thread_executor: threads that the system does not give are fewer threads, and the loops are whole") {
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    std::size_t pages = 0;
    std::FILE* const status = std::fopen("/proc/self/statm", "r");
    if (status == nullptr || std::fscanf(status, "%zu", &pages) != 1) ::_exit(3);
    std::fclose(status);
    const rlim_t bytes =
        static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + (rlim_t{200} << 20);
    const rlimit limit{bytes, bytes};
    if (::setrlimit(RLIMIT_AS, &limit) != 0) ::_exit(3);
    int code = 0;
    for (int again = 0; again < 3 && code == 0; ++again) {
      ThreadExecutor executor(500);
      std::atomic<std::size_t> sum{0};
      for (int loop = 0; loop < 100; ++loop) {
        executor.for_chunks(1000, 10, [&](std::size_t begin, std::size_t end, std::size_t worker) {
          if (worker >= executor.concurrency()) code = 4;
          for (std::size_t i = begin; i < end; ++i) sum.fetch_add(i, std::memory_order_relaxed);
        });
      }
      if (executor.concurrency() >= 500) code = 5;
      if (sum != 100 * 999 * 500) code = 6;
    }
    ::_exit(code);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  REQUIRE(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0);
}
#endif
