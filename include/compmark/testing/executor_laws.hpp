// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Laws E1-E4 of core/executor.hpp, for any executor:
//   const std::string broken = compmark::testing::executor_laws([](std::size_t threads) { return MyExecutor(threads);
//     });
//   REQUIRE_MESSAGE(broken.empty(), broken);
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/testing/violations.hpp"

namespace compmark {
namespace testing {

namespace detail {

/// Law E1 on one executor and one (n, grain): every index once, boundaries at multiples of the grain, worker ids below
/// concurrency().
template <Executor E>
void check_chunks(E& executor, std::size_t n, std::size_t grain, Violations& violations) {
  const std::string name = "n = " + std::to_string(n) + ", grain = " + std::to_string(grain) +
                           ", workers = " + std::to_string(static_cast<std::size_t>(executor.concurrency()));
  std::vector<std::atomic<std::uint32_t>> visits(n);
  std::atomic<bool> boundaries{true};
  std::atomic<bool> workers{true};
  executor.for_chunks(n, grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
    if (begin % grain != 0 || end != std::min(begin + grain, n) || begin >= end) boundaries = false;
    if (worker >= static_cast<std::size_t>(executor.concurrency())) workers = false;
    for (std::size_t i = begin; i < std::min(end, n); ++i) visits[i].fetch_add(1);
  });
  for (std::size_t i = 0; i < n; ++i) {
    if (visits[i] == 1) continue;
    violations.expect(false, "E1",
                      name + ": index " + std::to_string(i) + " was run " + std::to_string(visits[i]) + " times");
    break;
  }
  violations.expect(boundaries, "E1", name + ": a chunk is not [k grain, min((k + 1) grain, n))");
  violations.expect(workers, "E1", name + ": a worker id is not below concurrency()");
}

/// A worker id names at most one running body at a time: it is the key to per-worker scratch.
template <Executor E>
void check_worker_ids(E& executor, Violations& violations) {
  std::vector<std::atomic<int>> inside(std::max<std::size_t>(1, static_cast<std::size_t>(executor.concurrency())));
  std::atomic<bool> alone{true};
  executor.for_chunks(512, 1, [&](std::size_t begin, std::size_t, std::size_t worker) {
    if (worker >= inside.size()) return;
    if (inside[worker].fetch_add(1) != 0) alone = false;
    std::uint64_t busy = begin;
    for (int i = 0; i < 200; ++i) busy = mix_bits(busy);
    if (busy != 0) inside[worker].fetch_sub(1);
  });
  violations.expect(alone, "E1", "two bodies ran at once under one worker id");
}

/// The bits of a sum whose value depends on the order of its terms.
template <Executor E>
[[nodiscard]] std::uint64_t sum_bits(E& executor, std::size_t n, std::size_t grain) {
  const Random random(7, 0, random_stage("testing/executor_laws"));
  std::vector<double> partial(chunk_count(n, grain));
  const double sum = ordered_sum<double>(executor, n, grain, partial, [&](std::size_t begin, std::size_t end) {
    double part = 0;
    for (std::size_t i = begin; i < end; ++i) part += (random.uniform(i) - 0.5) * (i % 3 == 0 ? 1e12 : 1e-6);
    return part;
  });
  std::uint64_t bits = 0;
  std::memcpy(&bits, &sum, sizeof bits);
  return bits;
}

}  // namespace detail

/// Laws E1-E4 of core/executor.hpp. `make(threads)` gives an executor of about that many workers (it may give fewer).
/// Cost: some thousands of small loops, well below a second.
template <class Make>
[[nodiscard]] std::string executor_laws(const Make& make) {
  Violations violations;
  SerialExecutor serial;
  for (const std::size_t threads : {std::size_t{1}, std::size_t{2}, std::size_t{3}, std::size_t{8}}) {
    auto executor = make(threads);
    static_assert(Executor<decltype(executor)>,
                  "executor_laws: make(threads) must return an Executor (core/executor.hpp)");
    for (const std::size_t n :
         {std::size_t{1}, std::size_t{2}, std::size_t{63}, std::size_t{64}, std::size_t{65}, std::size_t{4097}}) {
      for (const std::size_t grain : {std::size_t{1}, std::size_t{7}, std::size_t{64}, std::size_t{10000}}) {
        detail::check_chunks(executor, n, grain, violations);
        violations.expect(detail::sum_bits(executor, n, grain) == detail::sum_bits(serial, n, grain), "E2",
                          "n = " + std::to_string(n) + ", grain = " + std::to_string(grain) + ", threads = " +
                              std::to_string(threads) + ": the ordered sum has other bits than the serial one");
      }
    }
    detail::check_worker_ids(executor, violations);

    for (const std::size_t bad : {std::size_t{0}, std::size_t{50}, std::size_t{99}}) {
      std::atomic<int> running{0};
      bool caught = false;
      int running_at_catch = -1;
      try {
        executor.for_chunks(100, 1, [&](std::size_t begin, std::size_t, std::size_t) {
          running.fetch_add(1);
          const bool fails = begin == bad;
          std::uint64_t busy = begin;
          for (int i = 0; i < 50; ++i) busy = mix_bits(busy);
          running.fetch_sub(busy != 0 ? 1 : 0);
          if (fails) throw std::runtime_error("testing/executor_laws");
        });
      } catch (const std::runtime_error&) {
        caught = true;
        running_at_catch = running.load();
      }
      violations.expect(caught, "E3", "the exception of chunk " + std::to_string(bad) + " did not reach the caller");
      violations.expect(!caught || running_at_catch == 0, "E3",
                        "a worker was still running when the exception arrived");
    }
    detail::check_chunks(executor, 1000, 10, violations);  // usable after an exception

    bool called = false;
    executor.for_chunks(0, 16, [&](std::size_t, std::size_t, std::size_t) { called = true; });
    violations.expect(!called, "E4", "for_chunks(0, …) called the body");
  }
  return violations.text();
}

}  // namespace testing
}  // namespace compmark
