// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs chunks in a oneTBB arena, for programs that own their threads with TBB. Link compmark::tbb. Obeys laws E1-E4
// (core/executor.hpp): TBB decides who runs a chunk, never what a chunk is.
#pragma once

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <cstddef>

#include "compmark/core/executor.hpp"

namespace compmark {

/// The worker id is the thread's slot in the arena, which no two running threads share. A body may start another loop:
/// it is isolated, so a waiting thread takes no chunk of the outer loop and its scratch stays its own.
class TbbExecutor {
 public:
  /// threads = 0 takes TBB's default.
  explicit TbbExecutor(std::size_t threads = 0)
      : concurrency_(threads != 0 ? threads : static_cast<std::size_t>(tbb::info::default_concurrency())),
        arena_(static_cast<int>(concurrency_)) {}

  [[nodiscard]] std::size_t concurrency() const { return concurrency_; }

  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    if (n == 0) return;
    const auto chunk = [&](std::size_t index) {
      const std::size_t begin = index * grain;
      body(begin, begin + grain < n ? begin + grain : n,
           static_cast<std::size_t>(tbb::this_task_arena::current_thread_index()));
    };
    arena_.execute([&] {
      tbb::this_task_arena::isolate(
          [&] { tbb::parallel_for(std::size_t{0}, chunk_count(n, grain), chunk, tbb::simple_partitioner{}); });
    });
  }

 private:
  std::size_t concurrency_;
  tbb::task_arena arena_;
};

}  // namespace compmark
