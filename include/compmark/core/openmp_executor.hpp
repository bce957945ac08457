// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs chunks in an OpenMP team, for programs that own their threads with OpenMP. Link compmark::openmp. Obeys laws
// E1-E4 (core/executor.hpp): chunks are handed out dynamically, their boundaries are fixed. The only header with an
// OpenMP pragma.
#pragma once

#if !defined(_OPENMP)
#error "compmark/core/openmp_executor.hpp needs OpenMP: link compmark::openmp or compile with -fopenmp"
#endif
#include <omp.h>

#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>

#include "compmark/core/executor.hpp"

namespace compmark {

/// An exception may not leave an OpenMP region: the first one is kept and thrown again after the region; chunks not yet
/// begun are dropped. A loop started inside a body runs serially in place, as in ThreadExecutor: loops do not nest.
class OpenMpExecutor {
 public:
  /// threads = 0 takes OpenMP's default (OMP_NUM_THREADS).
  explicit OpenMpExecutor(std::size_t threads = 0)
      : concurrency_(threads != 0 ? threads : static_cast<std::size_t>(omp_get_max_threads())) {}

  [[nodiscard]] std::size_t concurrency() const { return concurrency_; }

  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    if (n == 0) return;
    if (concurrency_ == 1 || omp_in_parallel() != 0) {
      SerialExecutor{}.for_chunks(n, grain, body);
      return;
    }
    std::atomic<std::size_t> next{0};
    std::exception_ptr failure;
    std::mutex failure_mutex;
    const auto work = [&] {
      const auto worker = static_cast<std::size_t>(omp_get_thread_num());
      try {
        for (;;) {
          const std::size_t begin = next.fetch_add(1, std::memory_order_relaxed) * grain;
          if (begin >= n) return;
          body(begin, begin + grain < n ? begin + grain : n, worker);
        }
      } catch (...) {
        const std::lock_guard lock(failure_mutex);
        if (!failure) failure = std::current_exception();
        next.store(chunk_count(n, grain), std::memory_order_relaxed);
      }
    };
#pragma omp parallel num_threads(static_cast <int>(concurrency_)) default(shared)
    work();
    if (failure) std::rethrow_exception(failure);
  }

 private:
  std::size_t concurrency_;
};

}  // namespace compmark
