// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/thread_executor.hpp"

#include <doctest/doctest.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <string>

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
