// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/executor.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <string>

#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/executor_laws.hpp"

using namespace compmark;

namespace {

// Executors with one defect each.
struct SkipsTheTail : SerialExecutor {
  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    for (std::size_t begin = 0; begin + grain <= n; begin += grain) body(begin, begin + grain, std::size_t{0});
  }
};
struct SwallowsExceptions : SerialExecutor {
  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    try {
      SerialExecutor{}.for_chunks(n, grain, body);
    } catch (...) {  // NOLINT(bugprone-empty-catch): this is the defect under test
    }
  }
};
struct CallsForNothing : SerialExecutor {
  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    if (n == 0) body(std::size_t{0}, std::size_t{0}, std::size_t{0});
    SerialExecutor{}.for_chunks(n, grain, body);
  }
};
struct HalvesTheGrainWithThreads {
  std::size_t threads = 1;
  [[nodiscard]] std::size_t concurrency() const { return threads; }
  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) const {
    SerialExecutor{}.for_chunks(n, threads > 1 && grain > 1 ? grain / 2 : grain, body);
  }
};

}  // namespace

TEST_CASE("core/executor: the serial executor obeys E1 to E4") {
  const std::string serial = testing::executor_laws([](std::size_t) { return SerialExecutor{}; });
  CHECK_MESSAGE(serial.empty(), serial);
}

TEST_CASE("core/executor: the laws catch an executor that breaks them (negative control)") {
  CHECK(testing::executor_laws([](std::size_t) { return SkipsTheTail{}; }).find("E1") != std::string::npos);
  CHECK(testing::executor_laws([](std::size_t) { return SwallowsExceptions{}; }).find("E3") != std::string::npos);
  CHECK(testing::executor_laws([](std::size_t) { return CallsForNothing{}; }).find("E4") != std::string::npos);
  CHECK(testing::executor_laws([](std::size_t threads) { return HalvesTheGrainWithThreads{threads}; }).find("E1") !=
        std::string::npos);
}

TEST_CASE("core/executor: chunk_count rounds up") {
  CHECK(chunk_count(0, 4) == 0);
  CHECK(chunk_count(1, 4) == 1);
  CHECK(chunk_count(4, 4) == 1);
  CHECK(chunk_count(5, 4) == 2);
}

TEST_CASE("core/executor: ordered_sum adds partial sums in index order") {
  // (1e16 + 1) + 1 … differs from 1e16 + (1 + 1 …): the order is visible in the result.
  SerialExecutor executor;
  std::array<double, 4> partial{};
  const std::array<double, 4> terms{1e16, 1.0, 1.0, -1e16};
  const double sum =
      ordered_sum<double>(executor, 4, 1, partial, [&](std::size_t begin, std::size_t) { return terms[begin]; });
  CHECK(sum == ((1e16 + 1.0) + 1.0) - 1e16);
  CHECK(sum != (1e16 + (1.0 + 1.0)) - 1e16);
}
