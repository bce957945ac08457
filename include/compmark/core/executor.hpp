// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept Executor: runs the loops. Threads come into the library only through it.
//
//   expression                       meaning                                                               cost
//   e.concurrency()                  number of workers; worker ids are 0 … concurrency() - 1               O(1)
//   e.for_chunks(n, grain, f)        f(begin, end, worker) for [0, grain), [grain, 2 grain) … up to n      one wake-up
//
// Laws (testing/laws.hpp): E1 each index is covered exactly once and chunk boundaries depend on n and grain alone; E2 a
// reduction over chunks, added in chunk order, has the same bits for any number of workers; E3 an exception of f
// reaches the caller, after all workers are done; E4 for_chunks with n = 0 does not call f.
#pragma once

#include <concepts>
#include <cstddef>
#include <span>

namespace compmark {

namespace detail {
struct AnyChunkBody {
  void operator()(std::size_t /*begin*/, std::size_t /*end*/, std::size_t /*worker*/) const {}
};
}  // namespace detail

template <class E>
concept Executor = requires(E& e, std::size_t n, const detail::AnyChunkBody& f) {
  { e.concurrency() } -> std::convertible_to<std::size_t>;
  e.for_chunks(n, n, f);
};

/// Number of chunks of at most `grain` that cover n.
[[nodiscard]] constexpr std::size_t chunk_count(std::size_t n, std::size_t grain) { return (n + grain - 1) / grain; }

/// Runs everything on the calling thread: the reference of every other executor.
struct SerialExecutor {
  [[nodiscard]] static constexpr std::size_t concurrency() { return 1; }
  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    for (std::size_t begin = 0; begin < n; begin += grain)
      body(begin, begin + grain < n ? begin + grain : n, std::size_t{0});
  }
};

/// Sum of map(begin, end) over fixed chunks, added in index order: same bits at any thread count.
/// `partial` is scratch of at least chunk_count(n, grain) values.
template <class Sum, Executor E, class Map>
[[nodiscard]] Sum ordered_sum(E& executor, std::size_t n, std::size_t grain, std::span<Sum> partial, const Map& map) {
  executor.for_chunks(
      n, grain, [&](std::size_t begin, std::size_t end, std::size_t) { partial[begin / grain] = map(begin, end); });
  Sum sum{};
  for (std::size_t chunk = 0; chunk < chunk_count(n, grain); ++chunk) sum += partial[chunk];
  return sum;
}

}  // namespace compmark
