// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/context_gs/context_gs_integers.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "compmark/codec/integer/integer_quantize.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

TEST_CASE(
    "context_gs/context_gs_integers: what a child reads of its parent is (k q - mean) / deviation, to half a unit") {
  const Random random(1, 0, random_stage("seen"));
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const double base = std::exp2(20 * random.uniform(8 * i) - 10);
    const double deviation = base * std::exp2(16 * random.uniform(8 * i + 1) - 6);
    const double mean = deviation * 4 * random.normal(8 * i + 2);
    const int index = -96 + static_cast<int>(random.bits(8 * i + 3) % 113);
    const double q = base * std::exp2(index / 16.0);
    const auto symbol = static_cast<std::int32_t>(std::lround((mean + 3 * deviation * random.normal(8 * i + 4)) / q));
    const SeenScale scale = seen_scale(mean, deviation, base);
    REQUIRE(scale.valid());
    const double exact = (symbol * q - mean) / deviation * 1024;
    const double found = ContextGsEvaluator::seen_input(scale, symbol, index);
    // The mean is kept to 2^-13 Q0, the factor to 2^-16 of itself, the ratio of the step to 2^-18.
    REQUIRE(std::abs(found - exact) <
            0.51 + 1024 * 0x1p-13 * base / deviation + 3e-5 * (std::abs(exact) + 1024 * std::abs(mean) / deviation));
  }
  // Held, not wrapped, however far out.
  for (const std::int32_t symbol : {greatest_symbol, INT32_MAX}) {
    CHECK(ContextGsEvaluator::seen_input(seen_scale(0, 1, 1), symbol, 16) == 32767);
    CHECK(ContextGsEvaluator::seen_input(seen_scale(0, 1, 1), -symbol, 16) == -32767);
  }
  CHECK(seen_scale(1e30, 1, 1).valid());
  CHECK(seen_scale(0, 1e30, 1).valid());
  CHECK(seen_scale(0, 1e-30, 1).valid());
}

/// A context of D = 3, K = 1, Z = 2 with random networks in floats and in integers.
struct Fixture {
  static constexpr std::size_t hidden = 24;
  ContextHeads heads{3, 6, 3};
  std::array<std::vector<float>, 3> weight1, bias1, weight2, bias2;
  std::vector<float> statistics;
  std::array<double, 3> base{1, 0.001, 0.2};
  IntegerContextGs context;

  Fixture() {
    const Random random(5, 0, random_stage("fixture"));
    std::uint64_t next = 0;
    const auto fill = [&](std::vector<float>& values, std::size_t count, double scale) {
      for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<float>(scale * random.normal(next++)));
    };
    context.heads = heads;
    context.channels = 2;
    context.cells = {20, 100};
    const std::array<float, 6> box{-1, -1, -1, 1, 1, 1};
    context.box = make_voxel_box(box, 0.001);
    context.prior.assign(2 * HyperpriorFormat::slots, 100);
    for (std::size_t c = 0; c < heads.channels(); ++c) {
      statistics.push_back(static_cast<float>(base[c < 3 ? 0 : c < 9 ? 1 : 2] * random.normal(next++)));
    }
    for (std::size_t c = 0; c < heads.channels(); ++c)
      statistics.push_back(static_cast<float>(base[c < 3 ? 0 : c < 9 ? 1 : 2] * (1 + random.uniform(next++))));
    for (std::size_t c = 0; c < 9; ++c)
      context.seen.push_back(seen_scale(statistics[c], statistics[heads.channels() + c], base[c < 3 ? 0 : 1]));
    for (std::size_t level = 0; level < 3; ++level) {
      const std::size_t inputs = context.inputs(level);
      fill(weight1[level], hidden * inputs, 0.4);
      fill(bias1[level], hidden, 0.2);
      fill(weight2[level], heads.outputs() * hidden, 0.2);
      fill(bias2[level], heads.outputs(), 0.2);
      IntegerNetworkSettings settings;
      settings.bits = WeightBits::all(16);
      settings.input_bits = IntegerContextGs::input_bits;
      settings.most_input = IntegerContextGs::most_input;
      settings.usual_input = 4 << IntegerContextGs::input_bits;
      auto network = quantize_network(
          {inputs, hidden, weight1[level], bias1[level], weight2[level], bias2[level], statistics}, heads, settings);
      REQUIRE(network.ok());
      context.network[level] = *network;
    }
    REQUIRE(context.check().ok());
  }
  [[nodiscard]] std::vector<double> outputs(std::size_t level, const std::vector<double>& input) const {
    std::vector<double> h(hidden), out(heads.outputs());
    for (std::size_t j = 0; j < hidden; ++j) {
      double sum = bias1[level][j];
      for (std::size_t i = 0; i < input.size(); ++i)
        sum += static_cast<double>(weight1[level][j * input.size() + i]) * input[i];
      h[j] = std::max(sum, 0.0);
    }
    for (std::size_t o = 0; o < out.size(); ++o) {
      out[o] = bias2[level][o];
      for (std::size_t j = 0; j < hidden; ++j) out[o] += static_cast<double>(weight2[level][o * hidden + j]) * h[j];
    }
    return out;
  }
};

TEST_CASE("context_gs/context_gs_integers: the networks say what training's would, whoever else is in the panel") {
  const Fixture f;
  // Row 0: level 2; row 1: level 1, child of 0; rows 2 to 21: level 0, children of 1.
  std::vector<Voxel> voxels{{-530, 20, 999}, {-560, 80, 940}};
  std::vector<std::uint32_t> parent{AnchorLevels::none, 0};
  for (int i = 0; i < 20; ++i) {
    voxels.push_back({-560 + i % 20, 80 - i, 940 + i / 2});
    parent.push_back(1);
  }
  std::vector<std::int32_t> z;
  for (int i = 0; i < 44; ++i) z.push_back(i % 7 - 3);
  std::vector<std::int16_t> seen(2 * 9);
  const ContextGsRows rows{voxels, parent, z, seen};
  const ContextGsEvaluator::Packed packed{f.context.network[0].pack(), f.context.network[1].pack(),
                                          f.context.network[2].pack()};
  std::array<std::array<double, 9>, 2> values{};
  for (std::size_t row = 0; row < 22; ++row) {
    const std::size_t level = row == 0 ? 2 : row == 1 ? 1 : 0, begin = row < 2 ? row : 2;
    ContextGsEvaluator evaluator(f.context, packed, rows, level, begin);
    const std::size_t first = (row - begin) / integer_panel * integer_panel, lane = (row - begin) % integer_panel;
    evaluator.look(first, std::min<std::size_t>(integer_panel, (row < 2 ? 1 : 20) - first));
    std::vector<double> input;
    if (level == 2) {
      for (const std::int32_t v : voxels[row]) input.push_back(0.001 * v);  // the box is [-1, 1]
    } else {
      const double edge = level == 1 ? 100 : 20;
      for (std::size_t axis = 0; axis < 3; ++axis)
        input.push_back((voxels[row][axis] - voxels[parent[row]][axis]) / edge);
      for (std::size_t c = 0; c < 9; ++c)
        input.push_back((values[parent[row]][c] - static_cast<double>(f.statistics[c])) /
                        static_cast<double>(f.statistics[12 + c]));
    }
    for (std::size_t c = 0; c < 2; ++c) input.push_back(z[2 * row + c]);
    const std::vector<double> expected = f.outputs(level, input);
    for (int group = 0; group < 3; ++group) {
      const double r = expected[f.heads.r_row(group)], index = std::max(16 * std::log2(1 + std::tanh(r)), -96.0);
      CHECK(std::abs(evaluator.step(group, lane) - index) < 0.5 + 0.3);
      for (std::size_t c = 0; c < f.heads.width(group); ++c) {
        const std::size_t channel = (group == 0 ? 0 : group == 1 ? 3 : 9) + c, g = static_cast<std::size_t>(group);
        const double mean = f.statistics[channel], deviation = f.statistics[12 + channel];
        const double found =
            evaluator.outputs()[(f.heads.mean_row(group) + c) * integer_panel + lane] / 4096.0 * f.base[g];
        CHECK(std::abs(found - (mean + deviation * expected[f.heads.mean_row(group) + c])) < 0.004 * deviation);
        const double log2 = evaluator.outputs()[(f.heads.sigma_row(group) + c) * integer_panel + lane] / 2048.0;
        CHECK(std::abs(log2 - (std::log2(deviation / f.base[g]) + expected[f.heads.sigma_row(group) + c])) < 0.004);
      }
    }
    if (row < 2) {
      for (std::size_t c = 0; c < 9; ++c) {
        const int group = c < 3 ? 0 : 1, index = evaluator.step(group, lane);
        const std::int32_t symbol = static_cast<std::int32_t>(c % 3) - 1;
        values[row][c] = static_cast<double>(symbol_value(symbol, index, f.base[c < 3 ? 0 : 1]));
        evaluator.tell(row - begin, c, symbol, index);
      }
    }
  }
}

TEST_CASE("context_gs/context_gs_integers: numbers of a file that could overflow or mean nothing are refused") {
  const Fixture f;
  const auto refused = [&](const auto& change) {
    IntegerContextGs context = f.context;
    change(context);
    return !context.check().ok();
  };
  CHECK_FALSE(refused([](IntegerContextGs&) {}));
  CHECK(refused([](IntegerContextGs& c) { c.cells.fine = 0; }));
  CHECK(refused([](IntegerContextGs& c) { c.box.scale[1] = 0; }));
  CHECK(refused([](IntegerContextGs& c) { c.seen.pop_back(); }));
  CHECK(refused([](IntegerContextGs& c) { c.seen[2].shift = 0; }));
  CHECK(refused([](IntegerContextGs& c) { c.seen[2].shift = 63; }));
  CHECK(refused([](IntegerContextGs& c) { c.prior[3] = 0; }));
  CHECK(refused([](IntegerContextGs& c) { c.prior[3] = 65'000; }));
  CHECK(refused([](IntegerContextGs& c) { c.channels = 3; }));
  CHECK(refused([](IntegerContextGs& c) { std::swap(c.network[0], c.network[2]); }));
  // Inputs reach 32767 here: weights that HAC's, up to 4096, would allow.
  CHECK(refused([](IntegerContextGs& c) {
    for (std::size_t i = 0; i < c.network[1].hidden.inputs; ++i) c.network[1].hidden.weight[i] = 8000;
  }));
}

}  // namespace
