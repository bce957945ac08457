// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Scratch memory of an executor's workers, each on memory pages of its own. Side by side, two workers' scratch shares
// cache lines at the seam, and the processor fetches lines ahead across it: each write of one worker then takes a line
// from the other. What that costs depends on where the seam falls (docs/notebook/measured.md).
#pragma once

#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"

namespace compmark {

inline constexpr std::size_t worker_page_bytes = 4096;

/// One T for every worker of an executor. Grow-only and never initialised, as Buffer is.
template <class T>
class PerWorker {
 public:
  void resize(std::size_t workers) { pages_.resize(workers); }
  [[nodiscard]] T& operator[](std::size_t worker) { return pages_[worker].value; }
  [[nodiscard]] const T& operator[](std::size_t worker) const { return pages_[worker].value; }
  [[nodiscard]] std::size_t size() const { return pages_.size(); }
  [[nodiscard]] std::size_t capacity_bytes() const { return pages_.capacity_bytes(); }

 private:
  struct alignas(worker_page_bytes) Page {
    T value;
  };
  Buffer<Page> pages_;
};

/// A row of `count` values for every worker of an executor. Grow-only and never initialised, as Buffer is. A kernel may
/// load or store a whole 64-byte pack that starts at any value of a row.
template <class T>
class PerWorkerRows {
  static_assert(worker_page_bytes % sizeof(T) == 0);

 public:
  void resize(std::size_t workers, std::size_t count) {
    constexpr std::size_t page = worker_page_bytes / sizeof(T);
    constexpr std::size_t pack = 64 / sizeof(T);
    stride_ = (count + pack + page - 1) / page * page;
    workers_ = workers;
    values_.resize(stride_ * workers + page);
  }
  /// The first of the worker's values.
  [[nodiscard]] T* row(std::size_t worker) {
    const auto begin = reinterpret_cast<std::uintptr_t>(values_.data());
    const std::size_t before = (worker_page_bytes - begin % worker_page_bytes) % worker_page_bytes;
    return values_.data() + before / sizeof(T) + worker * stride_;
  }
  [[nodiscard]] std::size_t size() const { return workers_; }
  [[nodiscard]] std::size_t capacity_bytes() const { return values_.capacity_bytes(); }

 private:
  Buffer<T> values_;
  std::size_t stride_ = 0;
  std::size_t workers_ = 0;
};

}  // namespace compmark
