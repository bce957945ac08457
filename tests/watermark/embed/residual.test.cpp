// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/embed/residual.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numeric>
#include <type_traits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;
static_assert(Embedder<ResidualFeature<float>> && Embedder<NoEmbedder> && present<ResidualFeature<float>>);

template <class T>
struct Table {
  static constexpr std::size_t rows = 23, columns = 19;  // not a multiple of a pack
  std::vector<T> plain, residual, marked, slope;
  std::vector<std::uint32_t> visible;
  typename ResidualFeature<T>::Context context;
  Table() {
    const Random random(3, 0, random_stage("residual test"));
    for (std::size_t i = 0; i < rows * columns; ++i) {
      plain.push_back(static_cast<T>(random.normal(i)));
      residual.push_back(static_cast<T>(2 * random.normal(i + 100000)));
      slope.push_back(static_cast<T>(random.normal(i + 200000)));
    }
    marked.assign(rows * columns, T(77));
    for (std::uint32_t row = 1; row < rows; row += 2) visible.push_back(row);
  }
  static MatrixView<T> view(std::vector<T>& values) { return {values.data(), rows, columns}; }
  template <Executor E>
  void forward(E& executor) {
    ResidualFeature<T>::forward(view(plain), view(residual), visible, view(marked), context, executor);
  }
};

}  // namespace

TEST_CASE("embed/residual: f^w = f + tanh f' on the listed rows, the others are left alone") {
  Table<double> table;
  SerialExecutor serial;
  table.forward(serial);
  for (std::size_t row = 0; row < table.rows; ++row) {
    for (std::size_t c = 0; c < table.columns; ++c) {
      const std::size_t i = row * table.columns + c;
      const double expected = row % 2 == 1 ? table.plain[i] + std::tanh(table.residual[i]) : 77.0;
      CHECK(table.marked[i] == doctest::Approx(expected).epsilon(1e-15));
    }
  }
}

TEST_CASE("embed/residual: gradient of the residual (central differences in double)") {
  Table<double> table;
  SerialExecutor serial;
  const auto loss = [&] {
    table.forward(serial);
    double sum = 0;
    for (const std::uint32_t row : table.visible) {
      for (std::size_t c = 0; c < table.columns; ++c) {
        const std::size_t i = row * table.columns + c;
        sum += table.slope[i] * table.marked[i];
      }
    }
    return sum;
  };
  static_cast<void>(loss());
  std::vector<double> d(table.rows * table.columns, 0.0);
  ResidualFeature<double>::backward(table.view(table.slope), table.visible, table.view(d), table.context, serial);
  CHECK(testing::gradient_law(loss, table.residual, d) == "");
}

TEST_CASE("embed/residual: the slope keeps its digits up to 40, far beyond where tanh is 1 (ML2)") {
  double worst = 0, worst_naive = 0;
  for (float x = 0.0f; x <= 40.0f; x += 0.0625f) {
    const float plain = 0.0f, one = 1.0f;
    float marked = 0, d = 0;
    const std::uint32_t row = 0;
    ResidualFeature<float>::Context context;
    SerialExecutor serial;
    ResidualFeature<float>::forward({&plain, 1, 1}, {&x, 1, 1}, {&row, 1}, {&marked, 1, 1}, context, serial);
    ResidualFeature<float>::backward({&one, 1, 1}, {&row, 1}, {&d, 1, 1}, context, serial);
    const long double cosh = std::cosh(static_cast<long double>(x)), exact = 1 / (cosh * cosh);
    const auto error = [&](float slope) { return static_cast<double>(std::abs(slope - exact) / exact); };
    worst = std::max(worst, error(d));
    worst_naive = std::max(worst_naive, error((1 - marked) * (1 + marked)));  // marked is tanh x
    if (x > 9.5f) CHECK((1 - marked) * (1 + marked) == 0.0f);                 // negative control: it would be stuck
  }
  MESSAGE("relative error of the slope: ", worst);
  CHECK(worst < 1e-6);
  CHECK(worst_naive == 1);  // negative control
}

TEST_CASE("embed/residual: a baked table is the marked one, to the bit, and its residual is zero") {
  Table<float> table;
  ThreadExecutor threads(3);
  std::iota(table.visible.begin(), table.visible.end(), 0u);
  table.visible.resize(table.rows);
  std::iota(table.visible.begin(), table.visible.end(), 0u);
  table.forward(threads);
  ResidualFeature<float>::bake(table.view(table.plain), table.view(table.residual));
  CHECK(table.plain == table.marked);
  CHECK(table.residual == std::vector<float>(table.rows * table.columns, 0.0f));
}
