// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/per_worker.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <type_traits>

using namespace compmark;

namespace {
namespace per_worker_test {

std::uintptr_t page_of(const void* place) { return reinterpret_cast<std::uintptr_t>(place) / worker_page_bytes; }

struct Odd {
  float values[1025];
};

}  // namespace per_worker_test
}  // namespace

TEST_CASE("core/per_worker: no two workers have a byte on one page") {
  PerWorker<per_worker_test::Odd> scratch;
  scratch.resize(5);
  for (std::size_t worker = 0; worker + 1 < 5; ++worker) {
    CHECK(per_worker_test::page_of(&scratch[worker].values[1024]) <
          per_worker_test::page_of(&scratch[worker + 1].values[0]));
  }
  CHECK(scratch.size() == 5);

  PerWorkerRows<float> wide;
  for (const std::size_t count : {std::size_t{1}, std::size_t{1000}, std::size_t{1024}, std::size_t{4099}}) {
    CAPTURE(count);
    wide.resize(4, count);
    for (std::size_t worker = 0; worker < 4; ++worker) {
      float* const row = wide.row(worker);
      CHECK(reinterpret_cast<std::uintptr_t>(row) % worker_page_bytes == 0);
      row[0] = row[count - 1] = static_cast<float>(worker);
      if (worker == 0) continue;
      // A whole pack that begins at the last value of the worker before ends before this worker's page.
      CHECK(per_worker_test::page_of(wide.row(worker - 1) + count - 1 + 15) < per_worker_test::page_of(row));
    }
    for (std::size_t worker = 0; worker < 4; ++worker) CHECK(wide.row(worker)[count - 1] == static_cast<float>(worker));
  }
}

TEST_CASE("core/per_worker: grow-only, as a buffer") {
  PerWorkerRows<double> wide;
  wide.resize(2, 3000);
  const std::size_t bytes = wide.capacity_bytes();
  wide.resize(2, 10);
  wide.resize(1, 3000);
  CHECK(wide.capacity_bytes() == bytes);
}
