// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The embedding as a bias against the concatenated input it stands for (docs/spec/method.md, 1.3).
#include "compmark/splat/anchor/appearance.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;

constexpr std::size_t hidden = 6, inputs = 5, embedded = 3, view_count = 4;

/// First layer of a colour head [6, 5 + 3], its bias, a table of four views, and a weight for each hidden unit in the
/// loss.
struct Layer {
  std::vector<double> weight = noise(hidden * (inputs + embedded), 1), bias = noise(hidden, 2),
                      table = noise(view_count * embedded, 3), d_bias = noise(hidden, 4);
  std::vector<double> d_weight = std::vector<double>(weight.size(), 0.5),
                      d_table = std::vector<double>(table.size(), 0.5);

  static std::vector<double> noise(std::size_t count, std::uint64_t seed) {
    const Random random(seed, 0, random_stage("appearance test"));
    std::vector<double> values(count);
    for (std::size_t i = 0; i < count; ++i) values[i] = random.normal(i);
    return values;
  }
  [[nodiscard]] std::vector<double> fold(std::size_t view) const {
    std::vector<double> folded(hidden);
    AppearanceEmbedding::fold<double>({weight.data(), hidden, inputs + embedded}, {bias.data(), 1, hidden},
                                      {table.data(), view_count, embedded}, view, folded.data());
    return folded;
  }
  void backward(std::size_t view) {
    AppearanceEmbedding::backward<double>(
        {weight.data(), hidden, inputs + embedded}, {table.data(), view_count, embedded}, view, d_bias.data(),
        {d_weight.data(), hidden, inputs + embedded}, {d_table.data(), view_count, embedded});
  }
};

}  // namespace

TEST_CASE("anchor/appearance: folded into the bias it is the layer of the concatenated input") {
  const Layer layer;
  const std::vector<double> x = Layer::noise(inputs, 9);
  for (std::size_t view = 0; view < view_count; ++view) {
    const std::vector<double> folded = layer.fold(view);
    for (std::size_t h = 0; h < hidden; ++h) {
      const double* const row = layer.weight.data() + h * (inputs + embedded);
      double whole = layer.bias[h], short_input = folded[h];
      for (std::size_t i = 0; i < inputs; ++i) whole += row[i] * x[i], short_input += row[i] * x[i];
      for (std::size_t a = 0; a < embedded; ++a) whole += row[inputs + a] * layer.table[view * embedded + a];
      CHECK(short_input == doctest::Approx(whole).epsilon(1e-14));
    }
  }
}

TEST_CASE("anchor/appearance: a view that was not trained looks like the mean of those that were") {
  const Layer layer;
  const std::vector<double> unseen = layer.fold(view_count);
  CHECK(layer.fold(~std::size_t{0}) == unseen);
  CHECK(layer.fold(0) != unseen);
  for (std::size_t h = 0; h < hidden; ++h) {  // the layer is linear: the mean embedding gives the mean of the layers
    double mean = 0;
    for (std::size_t view = 0; view < view_count; ++view) mean += layer.fold(view)[h] / static_cast<double>(view_count);
    CHECK(unseen[h] == doctest::Approx(mean).epsilon(1e-13));
  }
}

TEST_CASE("anchor/appearance: gradients of weights and embedding, added, of one view's row alone (A1)") {
  Layer layer;
  constexpr std::size_t view = 2;
  layer.backward(view);
  const auto loss = [&] {
    const std::vector<double> folded = layer.fold(view);
    double sum = 0;
    for (std::size_t h = 0; h < hidden; ++h) sum += layer.d_bias[h] * folded[h];
    return sum;
  };
  std::vector<double> d_weight = layer.d_weight, d_table = layer.d_table;
  for (double& g : d_weight) g -= 0.5;  // what was there before
  for (double& g : d_table) g -= 0.5;
  const std::string of_weight = testing::gradient_law(loss, layer.weight, d_weight, 1e-8);
  const std::string of_table = testing::gradient_law(loss, layer.table, d_table, 1e-8);
  CHECK_MESSAGE(of_weight.empty(), of_weight);
  CHECK_MESSAGE(of_table.empty(), of_table);
  for (std::size_t i = 0; i < d_table.size(); ++i) CHECK((d_table[i] == 0) == (i / embedded != view));
  for (std::size_t i = 0; i < d_weight.size(); ++i) CHECK((d_weight[i] == 0) == (i % (inputs + embedded) < inputs));
}
