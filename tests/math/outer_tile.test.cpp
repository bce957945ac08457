// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/outer_tile.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {

template <class T>
std::vector<T> normal_strip(std::size_t steps, std::uint64_t stream) {
  const Random random(5, stream, random_stage("test/outer tile"));
  std::vector<T> strip(steps * detail::strip_columns);
  for (std::size_t i = 0; i < strip.size(); ++i) strip[i] = static_cast<T>(random.normal(i));
  return strip;
}
/// One chain of fused multiply-adds each, as the tile promises: equal bits, not close ones.
template <class T, int W>
bool sums_are_plain(std::size_t steps) {
  constexpr std::size_t columns = detail::strip_columns;
  const std::vector<T> x = normal_strip<T>(steps, 0), y = normal_strip<T>(steps, 1);
  std::vector<T> products(columns * columns, T(7));
  detail::strip_products<T, W>(x.data(), y.data(), steps, products.data());
  bool same = true;
  for (std::size_t r = 0; r < columns; ++r) {
    for (std::size_t c = 0; c < columns; ++c) {
      Pack<T, 1> sum(T(0));
      for (std::size_t k = 0; k < steps; ++k)
        sum = fma(Pack<T, 1>(x[k * columns + r]), Pack<T, 1>(y[k * columns + c]), sum);
      same = same && products[r * columns + c] == sum.native;
    }
  }
  return same;
}

}  // namespace

TEST_CASE("math/outer_tile: every product of two strips is its plain sum to the bit, at any width") {
  for (const std::size_t steps : {0u, 1u, 2u, 63u, 64u}) {
    CAPTURE(steps);
    CHECK(sums_are_plain<double, native_width<double>>(steps));
    CHECK(sums_are_plain<double, 2>(steps));
    CHECK(sums_are_plain<double, 1>(steps));
    CHECK(sums_are_plain<float, native_width<float>>(steps));
    CHECK(sums_are_plain<float, 4>(steps));
    CHECK(sums_are_plain<long double, 1>(steps));
  }
}

TEST_CASE("math/outer_tile: strips are counted in whole ones") {
  CHECK(detail::strips_of(0) == 0);
  CHECK(detail::strips_of(1) == 1);
  CHECK(detail::strips_of(16) == 1);
  CHECK(detail::strips_of(17) == 2);
}
