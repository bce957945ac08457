// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/feature_offset.hpp"

#include <doctest/doctest.h>

#include <compmark/core/executor.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

using namespace compmark;

TEST_CASE("baselines/feature_offset: listed rows are sums, gradients are added, and baking leaves nothing beside") {
  using Offset = FeatureOffset<double>;
  static_assert(Embedder<Offset>);
  constexpr std::size_t rows = 5, columns = 3;
  std::vector<double> plain, offset, marked(rows * columns, -7.0), gradient(rows * columns, 0.25);
  for (std::size_t i = 0; i < rows * columns; ++i) {
    plain.push_back(0.1 * static_cast<double>(i));
    offset.push_back(0.5 - 0.3 * static_cast<double>(i * i % 7));
  }
  const std::vector<double> before = plain;
  const auto table = [](std::vector<double>& values) { return MatrixView<double>{values.data(), rows, columns}; };
  const auto read = [](const std::vector<double>& values) {
    return MatrixView<const double>{values.data(), rows, columns};
  };
  const std::vector<std::uint32_t> listed{3, 0};
  Offset::Context context;
  SerialExecutor executor;
  Offset::forward(read(plain), read(offset), listed, table(marked), context, executor);
  Offset::backward(read(plain), listed, table(gradient), context, executor);
  for (std::size_t i = 0; i < rows * columns; ++i) {
    const bool is_listed = i / columns == 3 || i / columns == 0;
    CHECK(marked[i] == (is_listed ? plain[i] + offset[i] : -7.0));
    CHECK(gradient[i] == (is_listed ? 0.25 + plain[i] : 0.25));
  }
  const std::vector<double> kept = offset;
  Offset::bake(table(plain), table(offset));
  for (std::size_t i = 0; i < rows * columns; ++i) {
    CHECK(plain[i] == before[i] + kept[i]);  // all rows, to the bit
    CHECK(offset[i] == 0);
  }
}
