// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A HiDDeN or strided decoder in training: input convention, space-to-depth stem, blocks (batch_block.hpp), mean over
// positions, linear (docs/spec/watermark.md, 1.1). Weights and running statistics are blocks of an arena under the
// names of the weight file, so that a checkpoint of the arena holds both; decoder_weights() makes the frozen decoder's
// tables. Kernels start by He's rule, those of the first block without a mean: a mean there answers to colour, which a
// crop changes (docs/spec/watermark.md, 1.6). Cost: three times the frozen decoder's forward pass an image.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/decoder/decoder_stem.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/input_convention.hpp"
#include "compmark/watermark/pretrain/batch_block.hpp"

namespace compmark {

struct ConvNetworkSettings {
  int bits = 48;
  int width = 32;
  int depth = 5;  ///< blocks of `width` channels; one more gives `features`
  int stem = 2;
  int features = 64;
  double epsilon = 1e-3;
  double momentum = 0.01;
  InputConvention input = imagenet_convention(0);
  std::uint64_t seed = 1;
};

template <class T>
class ConvNetwork {
 public:
  using Scalar = T;

  struct Context {
    std::vector<typename DecoderInput<T>::Context> input;
    std::vector<Buffer<T>> inner, d_inner;          ///< the network's input, image by image
    std::vector<std::vector<FeatureMaps<T>>> maps;  ///< of each block and of the stem, image by image
    std::vector<FeatureMaps<T>> d_maps, d_next;
    std::vector<typename BatchBlock<T>::Context> blocks;
    std::vector<T> pooled;  ///< [images, features]
  };

  ConvNetwork(const ConvNetworkSettings& settings, ParameterArena<T>& arena)
      : settings_(settings),
        convention_(settings.input) {
    const std::vector<DecoderLayer> layers =
        hidden_layers(settings.width, settings.depth, settings.features, settings.stem);
    for (std::size_t n = 0; n < layers.size(); ++n) {
      const ConvShape& s = layers[n].shape;
      blocks_.emplace_back(s, settings.epsilon, settings.momentum);
      const std::string name = "blocks." + std::to_string(n) + ".";
      const auto out = static_cast<std::size_t>(s.out);
      handles_.push_back(
          {arena.add(name + "conv.weight", out, s.taps(), RowKind::fixed, BlockRole::training,
                     LearningSchedule::fixed()),
           arena.add(name + "conv.bias", out, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed()),
           arena.add(name + "bn.weight", out, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed()),
           arena.add(name + "bn.bias", out, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed()),
           arena.add(name + "bn.running_mean", out, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed()),
           arena.add(name + "bn.running_var", out, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed())});
    }
    const auto bits = static_cast<std::size_t>(settings.bits), features = static_cast<std::size_t>(settings.features);
    linear_ =
        arena.add("linear.weight", bits, features, RowKind::fixed, BlockRole::training, LearningSchedule::fixed());
    offset_ = arena.add("linear.bias", bits, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed());
    initialise(arena);
  }

  [[nodiscard]] int bits() const { return settings_.bits; }
  [[nodiscard]] const ConvNetworkSettings& settings() const { return settings_; }
  /// Running statistics have no rate: forward moves them.
  [[nodiscard]] std::vector<double> rates(double rate) const {
    std::vector<double> result;
    for (std::size_t n = 0; n < handles_.size(); ++n) result.insert(result.end(), {rate, rate, rate, rate, 0, 0});
    result.insert(result.end(), {rate, rate});
    return result;
  }

  /// logits [images, bits], with the statistics of the batch.
  template <Executor E>
  void forward(ParameterArena<T>& arena, std::span<const ImageView<const T>> images, std::span<T> logits,
               Context& context, E& executor) {
    const std::size_t batch = images.size(), layers = blocks_.size();
    context.input.resize(batch);
    context.inner.resize(batch);
    context.maps.resize(layers + 1);
    context.maps[0].resize(batch);
    context.blocks.resize(layers);
    for (std::size_t i = 0; i < batch; ++i) {
      const auto [height, width] = convention_.convention().output_size(images[i].height, images[i].width);
      context.inner[i].resize(3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
      const ImageView<T> inner{context.inner[i].data(), 3, height, width};
      convention_.forward(images[i], inner, context.input[i], executor);
      space_to_depth(ImageView<const T>(inner), settings_.stem, context.maps[0][i], executor);
    }
    std::vector<FeatureView<const T>> input(batch);
    for (std::size_t n = 0; n < layers; ++n) {
      for (std::size_t i = 0; i < batch; ++i) input[i] = FeatureView<T>(context.maps[n][i].view());
      blocks_[n].forward(input, weights(arena, n), arena.values(handles_[n][4]).flat(),
                         arena.values(handles_[n][5]).flat(), context.maps[n + 1], context.blocks[n], executor);
    }
    pool(context);
    const MatrixView<const T> linear = arena.values(linear_);
    const std::size_t bits = linear.rows, features = linear.columns;
    for (std::size_t i = 0; i < batch; ++i) {
      for (std::size_t b = 0; b < bits; ++b) {
        T sum = arena.values(offset_)(b, 0);
        for (std::size_t f = 0; f < features; ++f) sum += linear(b, f) * context.pooled[i * features + f];
        logits[i * bits + b] = sum;
      }
    }
  }

  /// Adds to the arena's gradients and to d_images.
  template <Executor E>
  void backward(ParameterArena<T>& arena, std::span<const T> d_logits, std::span<const ImageView<T>> d_images,
                Context& context, E& executor) {
    const std::size_t batch = d_images.size(), layers = blocks_.size();
    head_backward(arena, d_logits, batch, context);
    for (std::size_t n = layers; n-- > 0;) {
      std::vector<FeatureView<T>> d_output;
      for (FeatureMaps<T>& map : context.d_maps) d_output.push_back(map.view());
      blocks_[n].backward(d_output, weights(arena, n), gradients(arena, n), context.d_next, context.blocks[n],
                          executor);
      std::swap(context.d_maps, context.d_next);
    }
    context.d_inner.resize(batch);
    for (std::size_t i = 0; i < batch; ++i) {
      const auto [height, width] = convention_.convention().output_size(d_images[i].height, d_images[i].width);
      context.d_inner[i].resize(context.inner[i].size());
      const ImageView<T> d_inner{context.d_inner[i].data(), 3, height, width};
      depth_to_space(FeatureView<const T>(context.d_maps[i].view()), settings_.stem, d_inner, executor);
      convention_.backward(d_inner, d_images[i], context.input[i], executor);
    }
  }

  /// The frozen decoder's tables, without whitening.
  [[nodiscard]] DecoderWeights decoder_weights(const ParameterArena<T>& arena) const {
    DecoderWeights result;
    result.kind = settings_.stem == 1 ? DecoderKind::hidden : DecoderKind::strided;
    result.bits = settings_.bits;
    result.width = settings_.width;
    result.depth = settings_.depth;
    result.stem = settings_.stem;
    result.norm_epsilon = settings_.epsilon;
    result.logit_scale = 1;
    result.input = settings_.input;
    result.layers = hidden_layers(settings_.width, settings_.depth, settings_.features, settings_.stem);
    const auto copy = [&](BlockHandle handle) {
      const std::span<const T> from = arena.values(handle).flat();
      std::vector<float> to(from.size());
      for (std::size_t i = 0; i < to.size(); ++i) to[i] = static_cast<float>(from[i]);
      return to;
    };
    for (std::size_t n = 0; n < blocks_.size(); ++n) {
      DecoderLayer& layer = result.layers[n];
      layer.weight = copy(handles_[n][0]);
      layer.bias = copy(handles_[n][1]);
      layer.norm_weight = copy(handles_[n][2]);
      layer.norm_bias = copy(handles_[n][3]);
      layer.norm_mean = copy(handles_[n][4]);
      layer.norm_variance = copy(handles_[n][5]);
    }
    result.linear_weight = copy(linear_);
    result.linear_bias = copy(offset_);
    return result;
  }

 private:
  void initialise(ParameterArena<T>& arena) const {
    const Random random(settings_.seed, 0, random_stage("mark/pretrain/conv_network"));
    std::uint64_t index = 0;
    for (std::size_t n = 0; n < blocks_.size(); ++n) {
      const MatrixView<T> weight = arena.values(handles_[n][0]);
      const double deviation = std::sqrt(2 / static_cast<double>(weight.columns));
      for (T& w : weight.flat()) w = static_cast<T>(deviation * random.normal(index++));
      for (std::size_t o = 0; n == 0 && o < weight.rows; ++o) {
        T sum(0);
        for (std::size_t k = 0; k < weight.columns; ++k) sum += weight(o, k);
        for (std::size_t k = 0; k < weight.columns; ++k) weight(o, k) -= sum / static_cast<T>(weight.columns);
      }
      for (T& gain : arena.values(handles_[n][2]).flat()) gain = T(1);
      for (T& variance : arena.values(handles_[n][5]).flat()) variance = T(1);
    }
    const MatrixView<T> linear = arena.values(linear_);
    const double deviation = 1 / std::sqrt(static_cast<double>(linear.columns));
    for (T& w : linear.flat()) w = static_cast<T>(deviation * random.normal(index++));
  }

  [[nodiscard]] BlockWeights<const T> weights(const ParameterArena<T>& arena, std::size_t n) const {
    return {arena.values(handles_[n][0]).flat(), arena.values(handles_[n][1]).flat(),
            arena.values(handles_[n][2]).flat(), arena.values(handles_[n][3]).flat()};
  }
  [[nodiscard]] BlockWeights<T> gradients(ParameterArena<T>& arena, std::size_t n) const {
    return {arena.gradients(handles_[n][0]).flat(), arena.gradients(handles_[n][1]).flat(),
            arena.gradients(handles_[n][2]).flat(), arena.gradients(handles_[n][3]).flat()};
  }

  void pool(Context& context) const {
    std::vector<FeatureMaps<T>>& maps = context.maps.back();
    const auto features = static_cast<std::size_t>(settings_.features);
    context.pooled.resize(maps.size() * features);
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const FeatureView<T> map = maps[i].view();
      for (std::size_t f = 0; f < features; ++f) {
        T sum(0);
        for (int y = 0; y < map.height; ++y) {
          const T* row = map.row(static_cast<int>(f), y);
          for (int x = 0; x < map.width; ++x) sum += row[x];
        }
        context.pooled[i * features + f] = sum / static_cast<T>(map.height * map.width);
      }
    }
  }

  void head_backward(ParameterArena<T>& arena, std::span<const T> d_logits, std::size_t batch, Context& context) const {
    const MatrixView<T> linear = arena.values(linear_), d_linear = arena.gradients(linear_);
    const std::size_t bits = linear.rows, features = linear.columns;
    context.d_maps.resize(batch);
    for (std::size_t i = 0; i < batch; ++i) {
      const FeatureView<T> map = context.maps.back()[i].view();
      context.d_maps[i].resize(map.channels, map.height, map.width);
      const FeatureView<T> d_map = context.d_maps[i].view();
      for (std::size_t f = 0; f < features; ++f) {
        T sum(0);
        for (std::size_t b = 0; b < bits; ++b) {
          sum += linear(b, f) * d_logits[i * bits + b];
          d_linear(b, f) += d_logits[i * bits + b] * context.pooled[i * features + f];
        }
        const T share = sum / static_cast<T>(map.height * map.width);
        for (int y = 0; y < map.height; ++y) std::fill_n(d_map.row(static_cast<int>(f), y), map.width, share);
      }
      for (std::size_t b = 0; b < bits; ++b) arena.gradients(offset_)(b, 0) += d_logits[i * bits + b];
    }
  }

  ConvNetworkSettings settings_;
  DecoderInput<T> convention_;
  std::vector<BatchBlock<T>> blocks_;
  std::vector<std::array<BlockHandle, 6>> handles_;
  BlockHandle linear_, offset_;
};

}  // namespace compmark
