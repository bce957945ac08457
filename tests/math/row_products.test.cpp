// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/row_products.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

using namespace compmark;

TEST_CASE("math/row_products: they are those of the plain sum, at any thread count") {
  for (const auto& size : {std::pair<std::size_t, std::size_t>{5, 3}, {16, 256}, {37, 5000}}) {
    const std::size_t rows = size.first, columns = size.second;
    CAPTURE(rows);
    const Random random(3, rows, random_stage("test/row products"));
    std::vector<float> table(rows * columns);
    for (std::size_t i = 0; i < table.size(); ++i) table[i] = static_cast<float>(random.normal(i));
    SerialExecutor serial;
    ThreadExecutor threads(3);
    const std::vector<double> products = row_products(std::span<const float>(table), rows, columns, serial);
    CHECK(products == row_products(std::span<const float>(table), rows, columns, threads));
    double worst = 0;
    for (std::size_t k = 0; k < rows; ++k) {
      for (std::size_t l = 0; l < rows; ++l) {
        double sum = 0;
        for (std::size_t i = 0; i < columns; ++i)
          sum += static_cast<double>(table[k * columns + i]) * static_cast<double>(table[l * columns + i]);
        worst = std::fmax(worst, std::abs(sum - products[k * rows + l]));
      }
    }
    CHECK(worst < 1e-9);  // of sums of up to 5,000 terms of size 1
  }
}
