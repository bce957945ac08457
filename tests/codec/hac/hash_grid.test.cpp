// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/hac/hash_grid.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

/// Small tables, dense and hashed levels of both kinds.
constexpr HashGridShape small_tables{.volume_resolution = {9, 18, 40},
                                     .volume_levels = 3,
                                     .volume_cap_log2 = 10,
                                     .plane_resolution = {20, 66},
                                     .plane_levels = 2,
                                     .plane_cap_log2 = 9};
template <class T, HashGridShape shape>
struct Table {
  std::vector<T> values;
  typename HashGrid<T, shape>::Context context;
  Table() : values(shape.bits()) {
    const Random random(1, 0, random_stage("hash grid test"));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<T>(1.3 * (2 * random.uniform(i) - 1));
    refresh();
  }
  void refresh() {
    SerialExecutor serial;
    HashGrid<T, shape>::binarise({values.data(), shape.entries(), 4}, context, serial);
  }
};
template <class T>
std::vector<T> positions(std::size_t count) {
  const Random random(2, 0, random_stage("hash grid test"));
  std::vector<T> unit(3 * count);
  for (std::size_t i = 0; i < unit.size(); ++i) {
    const double t = random.uniform(i);
    unit[i] = static_cast<T>(i % 7 == 0 ? t / 100 : (i % 7 == 1 ? 1 - t / 100 : t));  // many near the edges
  }
  unit[0] = unit[1] = unit[2] = T(0);
  unit[3] = unit[4] = unit[5] = T(1);
  return unit;
}
/// As published: vertices 0 and R - 1 are skipped and the weights that remain are divided by their sum, or are not, the negative control.
template <HashGridShape shape>
double published_interpolation(const std::vector<double>& values, const double* unit, int index, int feature,
                               bool divide) {
  const HashGridLevel level = shape.level(index);
  const int last = level.resolution - 1;
  double sum = 0, weights = 0;
  for (int corner = 0; corner < 1 << level.dimensions; ++corner) {
    double weight = 1;
    std::uint32_t at[3] = {};
    bool skip = false;
    for (int d = 0; d < level.dimensions; ++d) {
      const double p = unit[level.axis[static_cast<std::size_t>(d)]] * (level.resolution - 2) + 0.5;
      const int below = static_cast<int>(std::floor(p)), i = below + (corner >> d & 1);
      weight *= (corner >> d & 1) != 0 ? p - below : 1 - (p - below);
      skip = skip || i <= 0 || i >= last;
      at[d] = static_cast<std::uint32_t>(i);
    }
    if (skip) continue;
    const double value = values[4 * level.entry(at[0], at[1], at[2]) + static_cast<std::size_t>(feature)];
    sum += weight * (value >= 0 ? 1 : -1);
    weights += weight;
  }
  return divide ? sum / weights : sum;
}

}  // namespace

TEST_CASE(
    "hac/hash_grid: the published interpolation, which skips the outer vertices and divides by the weights left") {
  constexpr HashGridShape shape{};
  using Grid = HashGrid<double, shape>;
  static Table<double, shape> table;
  const std::vector<double> unit = positions<double>(60);
  std::vector<double> out(60 * Grid::channels);
  Grid::interpolate(table.context, unit.data(), 60, out.data(), Grid::channels);
  double worst = 0, worst_undivided = 0;
  for (std::size_t row = 0; row < 60; ++row) {
    for (int channel = 0; channel < shape.channels(); ++channel) {
      const double got = out[row * Grid::channels + static_cast<std::size_t>(channel)];
      const double* at = unit.data() + 3 * row;
      worst = std::max(
          worst, std::abs(got - published_interpolation<shape>(table.values, at, channel / 4, channel % 4, true)));
      worst_undivided =
          std::max(worst_undivided,
                   std::abs(got - published_interpolation<shape>(table.values, at, channel / 4, channel % 4, false)));
    }
  }
  CHECK(worst < 1e-11);
  CHECK(worst_undivided > 0.1);  // negative control
  // ... and in float, to what a coordinate's rounding moves within the finest cell.
  static Table<float, shape> narrow;
  const std::vector<float> float_unit = positions<float>(60);
  std::vector<float> float_out(60 * Grid::channels);
  HashGrid<float, shape>::interpolate(narrow.context, float_unit.data(), 60, float_out.data(), Grid::channels);
  double worst_float = 0;
  for (std::size_t i = 0; i < out.size(); ++i)
    worst_float = std::max(worst_float, std::abs(static_cast<double>(float_out[i]) - out[i]));
  CHECK(worst_float < 8 * 1026 * 0x1p-24);
}

TEST_CASE("hac/hash_grid: outside the box, not finite, and a box without extent") {
  using Grid = HashGrid<float, small_tables>;
  Table<float, small_tables> table;
  const float box[6] = {-1, 0, 5, 1, 0, 9}, nan = std::numeric_limits<float>::quiet_NaN();
  const MatrixView<const float> view{box, 2, 3};
  const auto sum = [&](float x, float y, float z) {
    const float position[3] = {x, y, z};
    float unit[3], out[Grid::channels], total = 0;
    Grid::normalise(view, position, unit);
    Grid::interpolate(table.context, unit, 1, out, Grid::channels);
    for (const float value : out) total += std::abs(value);
    return total;
  };
  CHECK(sum(0, 0, 6) > 10);   // the axis without extent is 0 everywhere
  CHECK(sum(-1, 0, 9) > 10);  // corners belong to the box
  CHECK(sum(nan, nan, nan) == 0);
  CHECK(sum(2, std::numeric_limits<float>::infinity(), 4) == 0);
  const float seen = sum(0, 0, 9.5f);  // outside in z alone: the plane xy still speaks
  CHECK(seen > 1);
  CHECK(seen <= 8);
}

TEST_CASE("hac/hash_grid: gradients are those of a linear map of the signs, and stop beyond +-1") {
  using Grid = HashGrid<double, small_tables>;
  constexpr std::size_t rows = 40;
  Table<double, small_tables> table;
  const std::vector<double> unit = positions<double>(rows);
  const Random random(3, 0, random_stage("hash grid test"));
  std::vector<double> slope(rows * Grid::channels), out(slope.size()), d_table(table.values.size(), 0.25);
  for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = random.normal(i);
  const auto loss = [&] {
    table.refresh();
    Grid::interpolate(table.context, unit.data(), rows, out.data(), Grid::channels);
    double sum = 0;
    for (std::size_t i = 0; i < out.size(); ++i)
      sum += slope[((i % Grid::channels) / 4 * rows + i / Grid::channels) * 4 + i % 4] * out[i];
    return sum;
  };
  static_cast<void>(loss());
  SerialExecutor serial;
  Grid::backward(table.context, unit.data(), rows, slope.data(), rows, 0.0, {d_table.data(), Grid::entries, 4}, serial);
  double worst = 0, size = 0;
  std::size_t stopped = 0, tested = 0;
  for (std::size_t i = 0; i < table.values.size(); i += 7) {
    const double kept = table.values[i];
    if (std::abs(kept) > 1) {
      CHECK(d_table[i] == 0);  // also what was there
      ++stopped;
      continue;
    }
    if (d_table[i] == 0.25 && i % 5 != 0) continue;  // few of those that nobody sees
    table.values[i] = 0.5;
    const double above = loss();
    table.values[i] = -0.5;
    const double below = loss();
    table.values[i] = kept;
    worst = std::max(worst, std::abs(d_table[i] - 0.25 - (above - below) / 2));
    size = std::max(size, std::abs(d_table[i]));
    ++tested;
  }
  CHECK(worst < 1e-12 * size);
  CHECK(stopped > 100);
  CHECK(tested > 100);
  // Negative control (QZ4): an estimator that passes every gradient has one where the value is held.
  std::vector<double> d_within(table.values.size(), 0.0), within = table.values;
  for (double& value : table.values) value = value > 0 ? 0.5 : -0.5;
  table.refresh();
  Grid::backward(table.context, unit.data(), rows, slope.data(), rows, 0.0, {d_within.data(), Grid::entries, 4},
                 serial);
  std::size_t passed = 0;
  for (std::size_t i = 0; i < within.size(); ++i) passed += std::abs(within[i]) > 1 && d_within[i] != 0 ? 1 : 0;
  CHECK(passed > 100);
}

TEST_CASE("hac/hash_grid: bits of the signs and their slope; a grid of one sign takes less than 64 bytes (CO1)") {
  using Grid = HashGrid<double, small_tables>;
  Table<double, small_tables> table;
  for (std::size_t i = 0; i < table.values.size(); ++i) table.values[i] = i % 4 == 0 ? -0.5 : 0.5;
  table.refresh();
  const double n = static_cast<double>(small_tables.bits());
  const double entropy = -0.75 * std::log2(0.75) - 0.25 * std::log2(0.25);
  CHECK(table.context.bits == doctest::Approx(n * entropy + 32).epsilon(1e-12));
  const double before = table.context.bits, slope = table.context.bits_slope;
  table.values[0] = 0.5;  // two of value more
  table.refresh();
  CHECK(table.context.bits - before == doctest::Approx(2 * slope).epsilon(1e-3));
  std::vector<double> d(table.values.size(), 1.0);
  SerialExecutor serial;
  table.values[5] = 1.5;
  table.refresh();
  Grid::backward(table.context, nullptr, 0, nullptr, 0, 0.01, {d.data(), Grid::entries, 4}, serial);
  CHECK(d[4] == doctest::Approx(1 + 0.01 * table.context.bits_slope));
  CHECK(d[5] == 0);
  for (double& value : table.values) value = 1e-9;
  table.refresh();
  CHECK(table.context.bits < 64 * 8);
  CHECK(std::isfinite(table.context.bits_slope));
  CHECK(table.context.bits_slope < 0);  // more ones still
}

TEST_CASE("hac/hash_grid: same bits at any thread count") {
  using Grid = HashGrid<float, small_tables>;
  constexpr std::size_t rows = 300;
  Table<float, small_tables> table;
  const std::vector<float> unit = positions<float>(rows);
  std::vector<float> slope(rows * Grid::channels);
  for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = std::sin(static_cast<float>(i));
  const auto run = [&](auto& executor) {
    std::vector<float> d(table.values.size(), 0.0f);
    Grid::binarise({table.values.data(), Grid::entries, 4}, table.context, executor);
    Grid::backward(table.context, unit.data(), rows, slope.data(), rows, 0.0, {d.data(), Grid::entries, 4}, executor);
    d.push_back(static_cast<float>(table.context.bits));
    return d;
  };
  SerialExecutor serial;
  ThreadExecutor threads(4);
  CHECK(run(serial) == run(threads));
}

TEST_CASE("hac/hash_grid: sixteen positions at once and one by one are the same bits, both ways") {
  constexpr HashGridShape shape{};
  using Grid = HashGrid<float, shape>;
  constexpr std::size_t rows = 157;  // two panels of 64, sixteen and some
  static Table<float, shape> table;
  std::vector<float> unit = positions<float>(rows);
  unit[31] = -0.5f;
  unit[44] = std::numeric_limits<float>::quiet_NaN();
  unit[49] = 3e9f;
  std::vector<float> together(rows * Grid::channels), alone(together.size());
  Grid::interpolate(table.context, unit.data(), rows, together.data(), Grid::channels);
  for (std::size_t row = 0; row < rows; ++row) {
    Grid::interpolate(table.context, unit.data() + 3 * row, 1, alone.data() + row * Grid::channels, Grid::channels);
  }
  CHECK(together == alone);
  SerialExecutor serial;
  std::vector<float> d_together(table.values.size(), 0.0f), d_alone = d_together, slope(together.size()),
                                                            one(Grid::channels);
  for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = std::sin(static_cast<float>(i));
  Grid::backward(table.context, unit.data(), rows, slope.data(), rows, 0.0, {d_together.data(), Grid::entries, 4},
                 serial);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t c = 0; c < Grid::channels; ++c) one[c] = slope[(c / 4 * rows + row) * 4 + c % 4];
    Grid::backward(table.context, unit.data() + 3 * row, 1, one.data(), 1, 0.0, {d_alone.data(), Grid::entries, 4},
                   serial);
  }
  CHECK(d_together == d_alone);
}
