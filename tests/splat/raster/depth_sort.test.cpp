// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/depth_sort.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/raster/transpose.hpp"

using namespace compmark;

namespace {

/// Sorts depths given in chunks of `grain` of which every third entry is missing; returns the indices in sorted order.
template <class T, Executor E>
std::vector<std::uint32_t> sorted(const std::vector<T>& depths, std::size_t grain, E& executor) {
  DepthSortWorkspace<T> workspace;
  const std::size_t chunks = chunk_count(depths.size(), grain);
  workspace.entries.resize(depths.size());
  workspace.counts.resize(chunks, 0u);
  DepthKey<T> smallest = ~DepthKey<T>{0}, largest = 0;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (i % 3 == 2) continue;
    const auto key = std::bit_cast<DepthKey<T>>(depths[i]);
    smallest = std::min(smallest, key);
    largest = std::max(largest, key);
    workspace.entries[i / grain * grain + workspace.counts[i / grain]++] = {key, static_cast<std::uint32_t>(i)};
  }
  const std::size_t count = depth_sort(workspace, chunks, grain, smallest, largest, executor);
  std::vector<std::uint32_t> order;
  for (std::size_t i = 0; i < count; ++i) order.push_back(workspace.entries[i].index);
  return order;
}

template <class T>
void check_against_stable_sort(const std::vector<T>& depths) {
  std::vector<std::uint32_t> expected;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (i % 3 != 2) expected.push_back(static_cast<std::uint32_t>(i));
  }
  std::stable_sort(expected.begin(), expected.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return depths[a] < depths[b]; });
  SerialExecutor serial;
  CHECK(sorted(depths, 64, serial) == expected);
  CHECK(sorted(depths, 1000, serial) == expected);
  for (const std::size_t threads : {2u, 4u, 8u}) {
    ThreadExecutor executor(threads);
    CHECK(sorted(depths, 64, executor) == expected);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("raster/depth_sort: equals a stable sort at any thread count, ties by index (TB4)", T, float,
                   double) {
  const Random random(1, 0, random_stage("test/depth_sort"));
  for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{17}, std::size_t{20000}}) {
    std::vector<T> depths(n);
    for (std::size_t i = 0; i < n; ++i) depths[i] = static_cast<T>(0.2 + 30 * random.uniform(i));
    check_against_stable_sort(depths);
    for (std::size_t i = 0; i < n; ++i)
      depths[i] = static_cast<T>(1 + static_cast<double>(random.below(i, 7)));  // mostly ties
    check_against_stable_sort(depths);
    for (std::size_t i = 0; i < n; ++i) depths[i] = T(3);  // only ties
    check_against_stable_sort(depths);
  }
  // Negative controls: a sort by depth alone that is not stable, and the bits of a depth that is not positive.
  std::vector<std::uint32_t> heap(17);
  std::iota(heap.begin(), heap.end(), 0u);
  const auto equal_depths = [](std::uint32_t, std::uint32_t) { return false; };
  std::make_heap(heap.begin(), heap.end(), equal_depths);
  std::sort_heap(heap.begin(), heap.end(), equal_depths);
  CHECK_FALSE(std::is_sorted(heap.begin(), heap.end()));
  CHECK(std::bit_cast<std::uint32_t>(-1.0f) > std::bit_cast<std::uint32_t>(1.0f));
}

TEST_CASE("raster/depth_sort: the last bit of a depth counts (TB5)") {
  std::vector<float> depths;
  std::uint32_t bits = std::bit_cast<std::uint32_t>(2.5f);
  for (std::uint32_t i = 0; i < 5000; ++i) depths.push_back(std::bit_cast<float>(bits + (i * 2654435761u) % 5000u));
  depths.push_back(1e-30f);
  depths.push_back(1e30f);
  check_against_stable_sort(depths);
  // Negative control: by their upper 16 bits.
  std::vector<float> coarse = depths;
  std::stable_sort(coarse.begin(), coarse.end(), [](float a, float b) {
    return std::bit_cast<std::uint32_t>(a) >> 16 < std::bit_cast<std::uint32_t>(b) >> 16;
  });
  CHECK_FALSE(std::is_sorted(coarse.begin(), coarse.end()));
}

TEST_CASE_TEMPLATE("raster/transpose: records are stored and loaded field by field", P, Pack<float, 16>, Pack<float, 8>,
                   Pack<double, 8>, Pack<double, 4>, Pack<float, 1>) {
  using T = typename P::Scalar;
  constexpr std::size_t W = P::width;
  std::array<P, 16> fields;
  for (std::size_t k = 0; k < 16; ++k) {
    for (std::size_t i = 0; i < W; ++i) fields[k].set(static_cast<int>(i), static_cast<T>(100 * k + i));
  }
  std::vector<T> memory(16 * W, T(-1));
  std::array<T*, W> to{};
  std::array<const T*, W> from{};
  for (std::size_t i = 0; i < W; ++i) {
    to[i] = i == 2 ? nullptr : memory.data() + 16 * (W - 1 - i);
    from[i] = memory.data() + 16 * (W - 1 - i);
  }
  detail::store_records<P>(fields, to);
  const auto back = detail::load_records<P>(from);
  for (std::size_t i = 0; i < W; ++i) {
    for (std::size_t k = 0; k < 16; ++k) {
      CHECK(back[k].lane(static_cast<int>(i)) == (i == 2 ? T(-1) : static_cast<T>(100 * k + i)));
      CHECK(from[i][k] == back[k].lane(static_cast<int>(i)));
    }
  }
}
