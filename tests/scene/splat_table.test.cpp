// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/splat_table.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {

constexpr std::array<double, 3> eye{0.3, -2, 5};

SplatTable random_table(std::size_t rows, int degree) {
  SplatTable table;
  table.resize(rows, degree);
  const Random random(8, 0, random_stage("splat table test"));
  std::uint64_t index = 0;
  table.for_each_column([&](std::vector<float>& column) {
    for (float& value : column) value = static_cast<float>(0.5 * random.normal(index++));
  });
  return table;
}

std::array<const double*, 14> pointers(const GaussianColumns<const double>& g) {
  return {g.mean[0],     g.mean[1],     g.mean[2],     g.scale[0], g.scale[1], g.scale[2], g.rotation[0],
          g.rotation[1], g.rotation[2], g.rotation[3], g.opacity,  g.color[0], g.color[1], g.color[2]};
}

/// A fixed linear function of all that to_gaussians gives.
double functional(const SplatTable& table, const std::vector<double>& weights) {
  SerialExecutor executor;
  GaussianBatch<double> batch;
  to_gaussians(table, eye, batch, executor);
  double sum = 0;
  const std::array<const double*, 14> columns = pointers(std::as_const(batch).columns());
  for (std::size_t c = 0; c < 14; ++c) {
    for (std::size_t i = 0; i < table.count; ++i) sum += weights[c * table.count + i] * columns[c][i];
  }
  return sum;
}

}  // namespace

TEST_CASE("scene/splat_table: explicit Gaussians survive the table, from any camera") {
  const Random random(9, 0, random_stage("splat table test"));
  constexpr std::size_t rows = 40;
  GaussianBatch<double> batch, back;
  batch.resize(rows);
  const GaussianColumns<double> g = batch.columns();
  for (std::size_t i = 0; i < rows; ++i) {
    const std::uint64_t key = 32 * i;
    double norm = 0;
    for (std::size_t k = 0; k < 4; ++k)
      g.rotation[k][i] = random.normal(key + k), norm += g.rotation[k][i] * g.rotation[k][i];
    for (std::size_t k = 0; k < 4; ++k) g.rotation[k][i] /= std::sqrt(norm);
    for (std::size_t k = 0; k < 3; ++k) {
      g.mean[k][i] = random.normal(key + 4 + k);
      g.scale[k][i] = std::exp(random.normal(key + 8 + k));
      g.color[k][i] = random.uniform(key + 12 + k);
    }
    g.opacity[i] = random.uniform(key + 16);
  }
  g.opacity[0] = 1;  // tanh reaches it in float
  g.scale[0][1] = 0;
  const SplatTable table = to_splat_table(std::as_const(batch).columns());
  SerialExecutor executor;
  to_gaussians(table, eye, back, executor);
  const std::array<const double*, 14> a = pointers(std::as_const(batch).columns()),
                                      b = pointers(std::as_const(back).columns());
  for (std::size_t c = 0; c < 14; ++c) {
    for (std::size_t i = 0; i < rows; ++i) {
      CHECK(std::isfinite(b[c][i]));
      CHECK(std::abs(a[c][i] - b[c][i]) < 2e-6 * (1 + std::abs(a[c][i])));  // log, logit and f_dc rounded to float
    }
  }
}

TEST_CASE("scene/splat_table: hard rows: zero quaternion, flat scale, opaque, dark colour, camera at the mean") {
  SplatTable table = random_table(1, 3);
  for (std::vector<float>& column : table.rotation) column[0] = 0;
  table.log_scale[2][0] = -std::numeric_limits<float>::infinity();
  table.opacity[0] = std::numeric_limits<float>::infinity();
  table.color(1, 0)[0] = -50;
  SerialExecutor executor;
  GaussianBatch<double> batch;
  const std::array<double, 3> at_mean{static_cast<double>(table.mean[0][0]), static_cast<double>(table.mean[1][0]),
                                      static_cast<double>(table.mean[2][0])};
  to_gaussians(table, at_mean, batch, executor);
  const GaussianColumns<const double> g = std::as_const(batch).columns();
  CHECK(g.rotation[0][0] == 1);
  CHECK(g.scale[2][0] == 0);
  CHECK(g.opacity[0] == 1);
  CHECK(g.color[1][0] == 0);  // clamped from below, as every viewer does
  CHECK(std::isfinite(g.color[0][0]));
}

TEST_CASE("scene/splat_table: to_gaussians_backward is the derivative of to_gaussians, in double") {
  SplatTable table = random_table(6, 3);
  table.color(2, 0)[4] = -20;  // clamped: exactly zero gradient
  const Random random(10, 0, random_stage("splat table test"));
  std::vector<double> weights(14 * table.count);
  for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = random.normal(i);

  SerialExecutor executor;
  GaussianBatch<double> batch, d_batch;
  to_gaussians(table, eye, batch, executor);
  d_batch.resize(table.count);
  const GaussianColumns<double> d = d_batch.columns();
  const std::array<double*, 14> d_columns{d.mean[0],  d.mean[1],     d.mean[2],     d.scale[0],    d.scale[1],
                                          d.scale[2], d.rotation[0], d.rotation[1], d.rotation[2], d.rotation[3],
                                          d.opacity,  d.color[0],    d.color[1],    d.color[2]};
  for (std::size_t c = 0; c < 14; ++c) {
    for (std::size_t i = 0; i < table.count; ++i) d_columns[c][i] = weights[c * table.count + i];
  }
  std::vector<std::vector<double>> found(3 + 4 + 1 + table.sh.size(), std::vector<double>(table.count));
  SplatTableGradient<double> gradient;
  std::size_t next = 0;
  for (double*& column : gradient.log_scale) column = found[next++].data();
  for (double*& column : gradient.rotation) column = found[next++].data();
  gradient.opacity = found[next++].data();
  while (next < found.size()) gradient.sh.push_back(found[next++].data());
  to_gaussians_backward(table, eye, std::as_const(batch).columns(), std::as_const(d_batch).columns(), gradient,
                        executor);

  std::vector<std::vector<float>*> columns;
  table.for_each_column([&](std::vector<float>& column) { columns.push_back(&column); });
  double naive_error = 0;
  for (std::size_t c = 0; c < found.size(); ++c) {
    std::vector<float>& column = *columns[3 + c];  // after the three means
    for (std::size_t i = 0; i < table.count; ++i) {
      const float value = column[i], up = value + 1e-3f, down = value - 1e-3f;
      column[i] = up;
      const double above = functional(table, weights);
      column[i] = down;
      const double below = functional(table, weights);
      column[i] = value;
      const double expected = (above - below) / (static_cast<double>(up) - static_cast<double>(down));
      // Central differences with a step of 1e-3: h^2 / 6 times a third derivative of order 1, so 1e-6; measured at most 2e-6.
      CHECK(std::abs(found[c][i] - expected) < 1e-5 * (1 + std::abs(expected)));
      if (c < 3) naive_error = std::max(naive_error, std::abs(d.scale[c][i] - expected));
    }
  }
  CHECK(naive_error > 0.1);  // negative control (CV8): the slope by the scale, taken for that by its logarithm
  for (std::size_t k = 0; k < 16; ++k) CHECK(gradient.sh[2 * 16 + k][4] == 0.0);
}

TEST_CASE("scene/splat_table: a colour that is held at 0 passes no gradient, decided once (BB6)") {
  // Degree 0 about the coefficient where 1/2 + f Y is 0: a few hundred neighbours in float, some of them exactly there.
  SplatTable table;
  table.resize(400, 0);
  float f = -0.5f / static_cast<float>(sh_constant);
  for (int i = 0; i < 200; ++i) f = std::nextafter(f, -10.0f);
  for (float& value : table.color(0, 0)) {
    value = f;
    f = std::nextafter(f, 10.0f);
  }
  SerialExecutor executor;
  GaussianBatch<float> batch, d_batch;
  to_gaussians(table, eye, batch, executor);
  d_batch.resize(table.count);
  for (float& value : d_batch.storage()) value = 1;
  std::vector<std::vector<float>> found(3 + 4 + 1 + 3, std::vector<float>(table.count));
  SplatTableGradient<float> gradient;
  std::size_t next = 0;
  for (float*& column : gradient.log_scale) column = found[next++].data();
  for (float*& column : gradient.rotation) column = found[next++].data();
  gradient.opacity = found[next++].data();
  while (next < found.size()) gradient.sh.push_back(found[next++].data());
  to_gaussians_backward(table, eye, std::as_const(batch).columns(), std::as_const(d_batch).columns(), gradient,
                        executor);
  const float* const color = std::as_const(batch).columns().color[0];
  std::size_t held = 0, free = 0, naive = 0;
  for (std::size_t i = 0; i < table.count; ++i) {
    CHECK((gradient.sh[0][i] != 0) == (color[i] > 0));
    held += color[i] == 0 ? 1 : 0;
    free += color[i] > 0 ? 1 : 0;
    naive += color[i] >= 0 ? 1 : 0;
  }
  CHECK(held > 50);
  CHECK(free > 50);
  CHECK(naive == table.count);  // negative control: asked with >=, every colour that is held passes it
}

TEST_CASE("scene/splat_table: harmonics above a degree are dropped, and the others stay where they were") {
  SplatTable table;
  table.resize(4, 3);
  for (std::size_t column = 0; column < table.sh.size(); ++column) {
    for (std::size_t row = 0; row < 4; ++row) table.sh[column][row] = static_cast<float>(10 * column + row);
  }
  const SplatTable before = table;
  table.limit_degree(3);
  CHECK(table.sh == before.sh);
  table.limit_degree(1);
  CHECK(table.degree == 1);
  REQUIRE(table.sh.size() == 12);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    for (std::size_t i = 0; i < 4; ++i) CHECK(table.color(channel, i) == before.color(channel, i));
  }
  table.limit_degree(2);  // what is not there does not come back
  CHECK(table.degree == 1);
  table.limit_degree(0);
  CHECK(table.sh.size() == 3);
  CHECK(table.color(2, 0) == before.color(2, 0));
}
