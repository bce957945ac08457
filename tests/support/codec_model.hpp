// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model as a codec gets it, for tests and benchmarks: anchors on a bumpy sphere, on grids of 1, 4 and 16 voxels as
// growing leaves them, values drawn from what its own context predicts (so that files have a real rate), masks that
// resemble those of their neighbours.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/hac/hac_encoder.hpp"
#include "compmark/core/random.hpp"
#include "support/context.hpp"

namespace compmark::testing {

struct CodecModelShape {
  std::size_t anchors = 300;
  int feature_dim = 6, offset_count = 3, chunk_anchors = 64;
  std::size_t hidden = 8;
  HashGridShape grid{.volume_levels = 2, .volume_cap_log2 = 7, .plane_levels = 1, .plane_cap_log2 = 8};
  bool networks = true;
};

/// The published sizes.
[[nodiscard]] inline CodecModelShape full_codec_model(std::size_t anchors) {
  return {anchors, 50, 10, 4096, 100, HashGridShape{}, true};
}

[[nodiscard]] inline CodecModel make_codec_model(std::uint64_t seed, const CodecModelShape& shape = {}) {
  const Random random(seed, 1, random_stage("codec model"));
  const FloatContextModel floats =
      make_float_context(seed, shape.grid, shape.feature_dim, shape.offset_count, shape.hidden, 1.5);
  CodecModel model;
  model.voxel_size = floats.voxel_size;
  model.feature_dim = shape.feature_dim;
  model.offset_count = shape.offset_count;
  model.chunk_anchors = shape.chunk_anchors;
  TrainedContext trained;
  trained.shape = shape.grid;
  trained.box = floats.box;
  trained.hidden = floats.hidden;
  for (std::size_t i = 0; i < shape.grid.entries(); ++i) {
    unsigned nibble = 0;
    for (unsigned f = 0; f < 4; ++f) nibble |= (floats.grid[4 * i + f] >= -0.5f ? 1u : 0u) << f;
    trained.signs.push_back(static_cast<std::uint8_t>(nibble));
  }
  trained.weight1 = floats.weight1;
  trained.bias1 = floats.bias1;
  trained.weight2 = floats.weight2;
  trained.bias2 = floats.bias2;
  trained.statistics = floats.statistics;
  model.trained = std::move(trained);

  const std::size_t n = shape.anchors, d = static_cast<std::size_t>(shape.feature_dim),
                    k = static_cast<std::size_t>(shape.offset_count);
  for (std::size_t i = 0; i < n; ++i) {
    double direction[3], length = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      direction[axis] = random.normal(4 * i + axis);
      length += direction[axis] * direction[axis];
    }
    const int grid = i % 5 == 0 ? 1 : i % 5 < 3 ? 4 : 16;
    const double bump = 700 + 80 * std::sin(5 * direction[0] / std::sqrt(length));
    Voxel voxel;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      voxel[axis] = grid * static_cast<int>(std::lround(bump * direction[axis] / std::sqrt(length) / grid));
    }
    model.voxels.push_back(voxel);
    std::uint32_t mask = 0;
    const double unmasked = 0.2 + 0.5 * std::abs(direction[0]) / std::sqrt(length);
    for (std::size_t o = 0; o < k; ++o)
      mask |= (random.uniform((std::uint64_t{1} << 40) + i * 32 + o) < unmasked ? 1u : 0u) << o;
    model.mask.push_back(mask);
  }
  model.feature.resize(n * d);
  model.scale.resize(n * 6);
  model.offset.resize(n * 3 * k);
  const auto context = detail::context_of(model, WeightBits{});
  if (!context) return {};
  const IntegerNetwork::Packed packed = context->network.pack();
  ContextEvaluator evaluator(*context, packed);
  std::vector<SymbolModel> models(std::max({d, 3 * k, std::size_t{6}}));
  std::uint64_t draw = std::uint64_t{1} << 50;
  for (std::size_t first = 0; first < n; first += integer_panel) {
    const std::size_t count = std::min<std::size_t>(integer_panel, n - first);
    evaluator.evaluate(std::span<const Voxel>(model.voxels).subspan(first, count));
    for (std::size_t lane = 0; lane < count; ++lane) {
      for (int group = 0; group < 3; ++group) {
        const std::size_t width = context->heads.width(group), row = first + lane;
        evaluator.models(group, lane, 0, width, models.data());
        const double q =
            model.base_step[static_cast<std::size_t>(group)] * std::exp2(evaluator.step(group, lane) / 16.0);
        float* const out = group == 0   ? model.feature.data() + row * d
                           : group == 1 ? model.scale.data() + row * 6
                                        : model.offset.data() + row * 3 * k;
        for (std::size_t c = 0; c < width; ++c) {
          const double sigma = std::exp2((models[c].sigma_index + GaussianTables::least_level) / 8.0);
          const double value = q * (models[c].mean / 32.0 + sigma * random.normal(draw++));
          out[c] = static_cast<float>(group == 1 ? std::max(value, 0.0) : value);
        }
      }
    }
  }
  if (shape.networks) {
    CodecTensor weight{"render.0.weight", {7, 5}, {}, TensorStorage::half};
    for (std::uint64_t i = 0; i < 35; ++i)
      weight.values.push_back(static_cast<float>(0.3 * random.normal((std::uint64_t{1} << 60) + i)));
    model.networks.push_back(weight);
    model.networks.push_back({"render.0.bias", {3}, {0.1f, -1e-20f, 70000.0f}, TensorStorage::half});
    model.networks.push_back({"exact", {2}, {0.1f, 3.14159265f}, TensorStorage::single});
    CodecTensor integers = weight;
    integers.name = "render.2.weight";
    integers.storage = TensorStorage::integer;
    integers.bits = 7;
    model.networks.push_back(integers);
  }
  model.metadata = {{"background", CodecValue{0.5}},
                    {"iteration", CodecValue{std::int64_t{30000}}},
                    {"scene", CodecValue{std::string("sphere")}}};
  return model;
}

}  // namespace compmark::testing
