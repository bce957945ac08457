// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/integer/integer_context.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/codec/integer/integer_quantize.hpp"
#include "compmark/core/random.hpp"
#include "support/context.hpp"

namespace {

using namespace compmark;
using Voxel = std::array<std::int32_t, 3>;

constexpr HashGridShape small_grid{.volume_levels = 5, .volume_cap_log2 = 10, .plane_levels = 2, .plane_cap_log2 = 11};

IntegerContext integers_of(const testing::FloatContextModel& model, int weight_bits = 12) {
  IntegerContext context;
  context.heads = model.heads();
  context.grid = IntegerHashGrid(model.shape, make_voxel_box(model.box, model.voxel_size));
  for (std::size_t i = 0; i < context.grid.entries().size(); ++i) {
    unsigned nibble = 0;
    for (unsigned f = 0; f < 4; ++f) nibble |= (model.grid[4 * i + f] >= 0 ? 1u : 0u) << f;
    context.grid.entries()[i] = static_cast<std::uint8_t>(nibble);
  }
  IntegerNetworkSettings settings;
  settings.bits = WeightBits::all(weight_bits);
  const auto network = quantize_network(model.view(), context.heads, settings);
  REQUIRE_MESSAGE(network.ok(), (network.ok() ? "" : network.error().line()));
  context.network = *network;
  REQUIRE(context.check().ok());
  return context;
}

std::vector<Voxel> voxels_in(const testing::FloatContextModel& model, std::size_t n, double margin = 0) {
  const Random random(11, 0, random_stage("integer context"));
  std::vector<Voxel> voxels(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double low = model.box[axis] - margin, high = model.box[3 + axis] + margin;
      voxels[i][axis] = static_cast<std::int32_t>(
          std::lround((low + (high - low) * random.uniform(3 * i + axis)) / model.voxel_size));
    }
  }
  return voxels;
}

TEST_CASE("integer/integer_hash_grid: features are those of the formulas, to the rounding of a 256th of a cell") {
  for (const HashGridShape& shape : {HashGridShape{}, small_grid}) {
    const testing::FloatContextModel model = testing::make_float_context(5, shape);
    const IntegerContext context = integers_of(model);
    const std::vector<Voxel> voxels = voxels_in(model, 320, 0.2);
    double worst = 0;
    std::size_t outside = 0;
    std::vector<std::int16_t> panel(static_cast<std::size_t>(shape.channels()) * integer_panel);
    for (std::size_t first = 0; first < voxels.size(); first += integer_panel) {
      context.grid.evaluate(std::span(voxels).subspan(first, integer_panel), panel.data());
      for (std::size_t lane = 0; lane < integer_panel; ++lane) {
        bool border = false;  // within a voxel of it, "inside" is a matter of the last digit
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double x = voxels[first + lane][axis] * model.voxel_size;
          border = border || std::abs(x - model.box[axis]) < 0.001 || std::abs(x - model.box[3 + axis]) < 0.001;
        }
        if (border) continue;
        const std::vector<double> expected = model.features(voxels[first + lane]);
        for (std::size_t c = 0; c < expected.size(); ++c) {
          const double value = panel[(c / 2 * integer_panel + lane) * 2 + c % 2] / 4096.0;
          worst = std::max(worst, std::abs(value - expected[c]));
        }
        outside += expected[0] == 0 && expected[1] == 0 && expected[2] == 0 ? 1 : 0;
      }
    }
    CHECK(worst < 3 * 0x1p-8 + 0x1p-13);  // three axes, half of 2^-8 each, slope 2; one rounding to 2^-12
    CHECK(worst > 0x1p-10);
    CHECK(outside > 20);
  }
}

TEST_CASE("integer/integer_hash_grid: a box is refused when it is of no use, and an axis without extent is none") {
  const std::array<float, 6> good{-1, 0, 5, 1, 2, 5}, inverted{-1, 0, 1, 1, 2, 0.5f}, far{-1, 0, 1e30f, 1, 2, 2e30f};
  const std::array<float, 6> no_number{-1, 0, std::numeric_limits<float>::quiet_NaN(), 1, 2, 1};
  CHECK(make_voxel_box(good, 0.001).valid());
  CHECK(!make_voxel_box(inverted, 0.001).valid());
  CHECK(!make_voxel_box(far, 0.001).valid());
  CHECK(!make_voxel_box(no_number, 0.001).valid());
  CHECK(make_voxel_box(good, 0.001).place(5000, 2) < 1u << 16);
  // Any coordinate of 32 bits has an answer.
  const VoxelBox box = make_voxel_box(good, 0.001);
  for (const std::int32_t v : {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()}) {
    CHECK(box.place(v, 0) == VoxelBox::outside);
  }
}

TEST_CASE("integer/integer_dot: the sums are those of the plain loop, to the extremes of 16 bits") {
  const Random random(12, 0, random_stage("integer context"));
  for (const std::size_t pairs : {std::size_t{1}, std::size_t{3}, std::size_t{50}}) {
    std::vector<std::int16_t> weight(4 * 2 * pairs), input(2 * pairs * integer_panel);
    for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = static_cast<std::int16_t>(random.bits(i) & 0xFFFFu);
    for (std::size_t i = 0; i < input.size(); ++i)
      input[i] = static_cast<std::int16_t>(random.bits(i + 5000) % 601 - 300);
    if (pairs == 1) {
      weight = {32767, 32767, -32767, -32767, 32767, -32767, 0, 1};
      std::fill(input.begin(), input.end(), std::int16_t{32767});
    }
    std::int32_t sums[4][integer_panel];
    detail::integer_dot(weight.data(), 2 * pairs, input.data(), pairs, sums);
    for (std::size_t row = 0; row < 4; ++row) {
      for (std::size_t lane = 0; lane < integer_panel; ++lane) {
        std::int64_t expected = 0;
        for (std::size_t c = 0; c < 2 * pairs; ++c) {
          expected += std::int64_t{weight[row * 2 * pairs + c]} * input[(c / 2 * integer_panel + lane) * 2 + c % 2];
        }
        CHECK(sums[row][lane] == expected);
      }
    }
  }
}

TEST_CASE("integer/integer_network: a network that could overflow for some input is refused") {
  const testing::FloatContextModel model = testing::make_float_context(6, small_grid, 8, 2, 12);
  const IntegerContext good = integers_of(model, 16);
  IntegerContext context = good;
  context.network.hidden.bias[3] = std::numeric_limits<std::int32_t>::max();
  CHECK(!context.check().ok());
  context = good;
  context.network.output.weight.assign(context.network.output.weight.size(), 32767);
  CHECK(!context.check().ok());
  context = good;
  context.network.output.weight[0] = std::numeric_limits<std::int16_t>::min();
  CHECK(!context.check().ok());
  context = good;
  context.network.hidden.shift[0] = -1;
  CHECK(!context.check().ok());
  context = good;
  context.network.output.shift[0] = 32;
  CHECK(!context.check().ok());
  context = good;
  context.network.output.bias.pop_back();
  CHECK(!context.check().ok());
  context = good;
  context.network.hidden = {};
  CHECK(!context.check().ok());
  CHECK(good.check().ok());
}

TEST_CASE("integer/integer_network: floats that are no numbers or not of the right count are refused") {
  testing::FloatContextModel model = testing::make_float_context(7, small_grid, 8, 2, 12);
  model.weight2[5] = std::numeric_limits<float>::infinity();
  CHECK(!quantize_network(model.view(), model.heads(), {}).ok());
  model = testing::make_float_context(7, small_grid, 8, 2, 12);
  model.statistics.pop_back();
  CHECK(!quantize_network(model.view(), model.heads(), {}).ok());
  model = testing::make_float_context(7, small_grid, 8, 2, 12);
  CHECK(!quantize_network(model.view(), model.heads(), {.bits = WeightBits::all(17)}).ok());
  // All zeros, and channels without any deviation, are legal.
  for (auto* tensor : {&model.weight1, &model.bias1, &model.weight2, &model.bias2, &model.statistics}) {
    std::fill(tensor->begin(), tensor->end(), 0.0f);
  }
  const IntegerContext context = integers_of(model);
  const IntegerNetwork::Packed packed = context.network.pack();
  ContextEvaluator evaluator(context, packed);
  const Voxel voxel{1, 2, 3};
  evaluator.evaluate(std::span(&voxel, 1));
  SymbolModel symbol;
  evaluator.models(0, 0, 0, 1, &symbol);
  CHECK(evaluator.step(0, 0) == 0);
  CHECK(symbol.sigma_index == 0);
  CHECK(symbol.mean == 0);
}

/// An interval's bits under a Gaussian with the floor of coding, in double.
double gaussian_bits(double symbol, double mean, double sigma) {
  const double s = std::max(sigma, 0.11), v = std::abs(symbol - mean);
  const double p = 0.5 * (std::erfc((v - 0.5) / s / std::sqrt(2.0)) - std::erfc((v + 0.5) / s / std::sqrt(2.0)));
  return -std::log2(std::max(p, 1e-300));
}

TEST_CASE(
    "integer/integer_context: coding with integers costs at most 0.3 % more than the float network's own Gaussians") {
  const GaussianTables tables;
  for (const int weight_bits : {5, 6, 7, 8, 10, 16}) {
    const testing::FloatContextModel model = testing::make_float_context(8);
    const IntegerContext context = integers_of(model, weight_bits);
    const IntegerNetwork::Packed packed = context.network.pack();
    ContextEvaluator evaluator(context, packed);
    const std::vector<Voxel> voxels = voxels_in(model, 160);
    const Random random(9, 0, random_stage("integer context"));
    const double base[3] = {1, 0.001, 0.2};
    const std::size_t channels = context.heads.channels();
    double ideal = 0, coded = 0, worst_r = 0, symbols = 0;
    std::uint64_t draw = 0;
    for (std::size_t first = 0; first < voxels.size(); first += integer_panel) {
      evaluator.evaluate(std::span(voxels).subspan(first, integer_panel));
      for (std::size_t lane = 0; lane < integer_panel; ++lane) {
        const std::vector<double> out = model.outputs(voxels[first + lane]);
        std::size_t statistic = 0;
        for (int group = 0; group < 3; ++group) {
          const std::size_t width = context.heads.width(group);
          const double exact = 16 * std::log2(1 + std::tanh(out[context.heads.r_row(group)]));
          const int index = evaluator.step(group, lane);
          worst_r = std::max(worst_r, std::abs(std::max(exact, -96.0) - index));
          const double q = base[group] * std::exp2(index / 16.0);
          std::vector<SymbolModel> models(width);
          evaluator.models(group, lane, 0, width, models.data());
          for (std::size_t c = 0; c < width; ++c, ++statistic) {
            const double m = model.statistics[statistic], d = model.statistics[channels + statistic];
            const double mean = (m + d * out[context.heads.mean_row(group) + c]) / q;
            const double sigma = d * std::exp2(out[context.heads.sigma_row(group) + c]) / q;
            const double symbol = std::nearbyint(mean + sigma * random.normal(draw++));
            ideal += gaussian_bits(symbol, mean, sigma);
            coded += ideal_bits(tables, models[c], static_cast<std::int32_t>(symbol));
            symbols += 1;
          }
        }
      }
    }
    MESSAGE(weight_bits, " bits a weight: ", ideal / symbols, " bits a symbol, coded with ", 100 * (coded / ideal - 1),
            " % more; step index off by at most ", worst_r);
    if (weight_bits >= 8) {
      CHECK(coded < 1.003 * ideal);
      CHECK(worst_r < 0.8);
    }
  }
}

TEST_CASE("integer/integer_network: a float network of the integers makes the same integers again") {
  for (const int weight_bits : {2, 5, 7, 12, 16}) {
    CAPTURE(weight_bits);
    const testing::FloatContextModel model = testing::make_float_context(8);
    const IntegerContext context = integers_of(model, weight_bits);
    IntegerNetworkSettings settings;
    settings.bits = WeightBits::all(weight_bits);
    const FloatNetwork floats = float_network(context.network, context.heads, model.view().statistics, settings);
    FloatContext view = model.view();
    view.weight1 = floats.weight1;
    view.bias1 = floats.bias1;
    view.weight2 = floats.weight2;
    view.bias2 = floats.bias2;
    const auto again = quantize_network(view, context.heads, settings);
    REQUIRE(again.ok());
    CHECK(again->hidden == context.network.hidden);
    CHECK(again->output == context.network.output);
  }
}

TEST_CASE("integer/integer_context: lanes do not know of one another") {
  const testing::FloatContextModel model = testing::make_float_context(10, small_grid, 8, 2, 12);
  const IntegerContext context = integers_of(model);
  const IntegerNetwork::Packed packed = context.network.pack();
  ContextEvaluator all(context, packed), one(context, packed);
  const std::vector<Voxel> voxels = voxels_in(model, 11);
  all.evaluate(voxels);
  for (std::size_t lane = 0; lane < voxels.size(); ++lane) {
    one.evaluate(std::span(voxels).subspan(lane, 1));
    for (int group = 0; group < 3; ++group) {
      CHECK(all.step(group, lane) == one.step(group, 0));
      std::vector<SymbolModel> a(context.heads.width(group)), b(a.size());
      all.models(group, lane, 0, a.size(), a.data());
      one.models(group, 0, 0, b.size(), b.data());
      for (std::size_t c = 0; c < a.size(); ++c) {
        CHECK(a[c].mean == b[c].mean);
        CHECK(a[c].sigma_index == b[c].sigma_index);
      }
    }
  }
}

}  // namespace
