// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A context as training could leave it, for the tests and benchmarks of the coding side: hash grid values, network and
// statistics from a counter, and the float forward pass in double to compare with, written from the formulas
// (docs/spec/compression.md, 1.1 to 1.3).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/hac/hash_grid_layout.hpp"
#include "compmark/codec/integer/integer_quantize.hpp"
#include "compmark/core/random.hpp"

namespace compmark::testing {

struct FloatContextModel {
  HashGridShape shape;
  int feature_dim = 50, offset_count = 10;
  std::size_t hidden = 100;
  std::array<float, 6> box{-1.3f, -1.1f, -0.9f, 1.2f, 1.4f, 1.0f};
  double voxel_size = 0.001;
  std::vector<float> grid;  ///< [entries, 4]
  std::vector<float> weight1, bias1, weight2, bias2, statistics;

  [[nodiscard]] ContextHeads heads() const { return {feature_dim, 6, 3 * offset_count}; }
  [[nodiscard]] FloatContext view() const {
    return {static_cast<std::size_t>(shape.channels()), hidden, weight1, bias1, weight2, bias2, statistics};
  }

  /// Features of a voxel, [-1, 1] each.
  [[nodiscard]] std::vector<double> features(const std::array<std::int32_t, 3>& voxel) const {
    std::array<double, 3> t{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double low = box[axis], high = box[3 + axis];
      t[axis] = (voxel[axis] * voxel_size - low) / (high - low);
    }
    std::vector<double> out;
    for (int index = 0; index < shape.levels(); ++index) {
      const HashGridLevel level = shape.level(index);
      std::array<double, 4> sum{};
      bool inside = true;
      std::array<std::array<std::uint32_t, 2>, 3> at{};
      std::array<std::array<double, 2>, 3> weight{};
      weight[2][0] = 1;
      for (std::size_t d = 0; d < static_cast<std::size_t>(level.dimensions); ++d) {
        const double place = t[static_cast<std::size_t>(level.axis[d])];
        inside = inside && place >= 0 && place <= 1;
        const double p = place * (level.resolution - 2) + 0.5;
        const int cell = static_cast<int>(std::floor(p));
        at[d] = {static_cast<std::uint32_t>(level.clamped(cell)), static_cast<std::uint32_t>(level.clamped(cell + 1))};
        weight[d] = {1 - (p - cell), p - cell};
      }
      for (std::size_t v = 0; inside && v < (level.dimensions == 3 ? 8u : 4u); ++v) {
        const std::uint32_t entry = level.entry(at[0][v & 1], at[1][v >> 1 & 1], at[2][v >> 2]);
        const double w = weight[0][v & 1] * weight[1][v >> 1 & 1] * weight[2][v >> 2];
        for (std::size_t f = 0; f < 4; ++f) sum[f] += grid[4 * entry + f] >= 0 ? w : -w;
      }
      out.insert(out.end(), sum.begin(), sum.end());
    }
    return out;
  }
  /// The network's outputs for a voxel.
  [[nodiscard]] std::vector<double> outputs(const std::array<std::int32_t, 3>& voxel) const {
    const std::vector<double> in = features(voxel);
    std::vector<double> h(hidden), out(heads().outputs());
    for (std::size_t j = 0; j < hidden; ++j) {
      double sum = bias1[j];
      for (std::size_t i = 0; i < in.size(); ++i) sum += static_cast<double>(weight1[j * in.size() + i]) * in[i];
      h[j] = std::max(sum, 0.0);
    }
    for (std::size_t o = 0; o < out.size(); ++o) {
      double sum = bias2[o];
      for (std::size_t j = 0; j < hidden; ++j) sum += static_cast<double>(weight2[o * hidden + j]) * h[j];
      out[o] = sum;
    }
    return out;
  }
};

/// `narrow`: how far below their channels' deviations the predicted ones lie, octaves.
[[nodiscard]] inline FloatContextModel make_float_context(std::uint64_t seed, const HashGridShape& shape = {},
                                                          int feature_dim = 50, int offset_count = 10,
                                                          std::size_t hidden = 100, double narrow = 1) {
  FloatContextModel model;
  model.shape = shape;
  model.feature_dim = feature_dim;
  model.offset_count = offset_count;
  model.hidden = hidden;
  const Random random(seed, 0, random_stage("float context"));
  std::uint64_t next = 0;
  const auto fill = [&](std::vector<float>& values, std::size_t count, double scale) {
    values.resize(count);
    for (float& value : values) value = static_cast<float>(scale * random.normal(next++));
  };
  const auto inputs = static_cast<std::size_t>(shape.channels());
  const ContextHeads heads = model.heads();
  fill(model.grid, 4 * shape.entries(), 1);
  fill(model.weight1, hidden * inputs, 1.5 / std::sqrt(static_cast<double>(inputs)));
  fill(model.bias1, hidden, 0.2);
  fill(model.weight2, heads.outputs() * hidden, 1.0 / std::sqrt(static_cast<double>(hidden)));
  fill(model.bias2, heads.outputs(), 0.2);
  for (int group = 0; group < 3; ++group) {
    for (std::size_t c = 0; c < heads.width(group); ++c)
      model.bias2[heads.sigma_row(group) + c] -= static_cast<float>(narrow);
    for (std::size_t j = 0; j < hidden; ++j) model.weight2[heads.r_row(group) * hidden + j] *= 0.5f;
  }
  model.statistics.resize(2 * heads.channels());
  for (std::size_t c = 0; c < heads.channels(); ++c) {
    const int group = c < heads.width(0) ? 0 : c < heads.width(0) + 6 ? 1 : 2;
    const double scale = group == 0 ? 2 : group == 1 ? 0.01 : 0.5;
    model.statistics[c] = static_cast<float>(scale * (group == 1 ? 3 : random.normal(next++)));
    model.statistics[heads.channels() + c] = static_cast<float>(scale * std::exp2(random.normal(next++)));
  }
  return model;
}

}  // namespace compmark::testing
