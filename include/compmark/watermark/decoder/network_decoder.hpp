// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The network of the convolutional message decoders: input convention, stem, blocks of convolution and activation,
// means over positions, one linear map (docs/spec/watermark.md, 1.1). Normalisation is folded into the convolutions,
// linear and whitening into one matrix, in double. forward() keeps the slope of every activation, so that backward() is
// one convolution a layer. Cost: 2 multiply-adds a weight and position forward, the same backward. Longer than 300
// lines: forward and backward share the maps of a context.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/gelu.hpp"
#include "compmark/watermark/decoder/decoder_convolution.hpp"
#include "compmark/watermark/decoder/decoder_pool.hpp"
#include "compmark/watermark/decoder/decoder_stem.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/input_convention.hpp"
#include "compmark/watermark/decoder/subject_box.hpp"

namespace compmark {

namespace detail {
struct GeluActivation {
  template <class P>
  COMPMARK_INLINE Activated<P> operator()(P x) const {
    return gelu_with_slope(x);
  }
};
struct ReluActivation {
  template <class P>
  COMPMARK_INLINE Activated<P> operator()(P x) const {
    using T = typename P::Scalar;
    return {max(P(T(0)), x), keep(x > P(T(0)), P(T(1)))};  // a NaN is the second operand, which max returns
  }
};
}  // namespace detail

/// T is float in production, double in tests. `Kernel` is the convolution policy (decoder_convolution.hpp).
template <class T, template <class> class Kernel = DirectConvolution>
class NetworkDecoder {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;

  /// What a forward pass leaves for the backward pass, and scratch; grow-only.
  struct Context {
    /// Of one part of the image.
    struct Reading {
      typename DecoderInput<T>::Context input;
      PictureCut<T> cut;
      Buffer<T> converted;                 ///< [3, h, w] the part as the network sees it, then its gradient
      std::vector<FeatureMaps<T>> slopes;  ///< of each layer's activation, in the layout of its output
      std::vector<Buffer<std::uint8_t>> choices;
      int height = 0;  ///< of the network's input, before the stem
      int width = 0;
    };
    std::array<Reading, ReadParts::most> readings;
    ReadParts parts;
    std::array<FeatureMaps<T>, 2> maps;  ///< values, then gradients: of this layer and the next
    typename Kernel<T>::Scratch convolution;
    Buffer<double> features;
    Buffer<double> part_features;
    Buffer<double> d_features;
  };

  NetworkDecoder() = default;
  /// `head` maps the features to logits.
  NetworkDecoder(const DecoderWeights& weights, DecoderHead head)
      : input_(weights.input),
        stem_(weights.stem),
        activation_(weights.activation),
        logit_scale_(weights.logit_scale),
        head_(std::move(head)) {
    std::vector<T> weight, bias;
    for (const DecoderLayer& layer : weights.layers) {
      fold_normalisation(layer, weights.norm_epsilon, weight, bias);
      layers_.push_back({Kernel<T>(layer.shape, weight, bias), layer.pool, layer.tap});
    }
    COMPMARK_ASSERT(!layers_.empty() && layers_.back().tap && head_.columns == weights.features(),
                    "NetworkDecoder: weights");
    minimum_size_ = smallest_picture(weights);
    COMPMARK_ASSERT(minimum_size_ != 0, "NetworkDecoder: layers that no image fits");
  }

  [[nodiscard]] int bits() const { return head_.rows; }
  [[nodiscard]] int features() const { return head_.columns; }
  /// The factor of logits in a message loss, from the file.
  [[nodiscard]] double logit_scale() const { return logit_scale_; }
  [[nodiscard]] const InputConvention& input() const { return input_.convention(); }
  /// Smaller images would leave a kernel that sees more border than image, or a layer without a position.
  [[nodiscard]] int minimum_size() const { return minimum_size_; }

  /// Fills features() means over positions and parts of the image, before the head: what whitening statistics are made
  /// of.
  template <Executor E>
  void forward_features(ImageView<const T> image, std::span<double> features, Context& context, E& executor) const {
    context.parts = read_parts(input(), image, minimum_size());
    run(image, 0, features, context, executor, false);
    if (context.parts.count == 1) return;
    context.part_features.resize(features.size());
    for (std::size_t part = 1; part < context.parts.count; ++part) {
      run(image, part, context.part_features.span(), context, executor, false);
      for (std::size_t f = 0; f < features.size(); ++f) features[f] += context.part_features[f];
    }
    for (double& feature : features) feature /= static_cast<double>(context.parts.count);
  }

  /// ADDS the means of the last layer before its activation, and those of its squares, for batch normalisation; of the
  /// first part alone.
  template <Executor E>
  void add_moments(ImageView<const T> image, std::span<double> mean, std::span<double> square, Context& context,
                   E& executor) const {
    context.features.resize(mean.size());
    context.parts = read_parts(input(), image, minimum_size());
    const FeatureView<T> maps = run(image, 0, context.features.span(), context, executor, true);
    for (std::size_t c = 0; c < mean.size(); ++c) mean[c] += context.features[c];
    for (int c = 0; c < maps.channels; ++c) {
      for (int y = 0; y < maps.height; ++y) {
        for (int x = 0; x < maps.width; ++x) maps.row(c, y)[x] *= maps.row(c, y)[x];
      }
    }
    mean_over_positions(FeatureView<const T>(maps), context.features.span(), executor);
    for (std::size_t c = 0; c < square.size(); ++c) square[c] += context.features[c];
  }

  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context& context, E& executor) const {
    COMPMARK_ASSERT(logits.size() == static_cast<std::size_t>(bits()), "NetworkDecoder: logits");
    context.features.resize(static_cast<std::size_t>(features()));
    forward_features(image, context.features.span(), context, executor);
    for (std::size_t r = 0; r < logits.size(); ++r) {
      double sum = head_.offset[r];
      const double* const row = head_.matrix.data() + r * context.features.size();
      for (std::size_t f = 0; f < context.features.size(); ++f) sum += row[f] * context.features[f];
      logits[r] = static_cast<T>(sum);
    }
  }

  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& context, E& executor) const {
    COMPMARK_ASSERT(d_logits.size() == static_cast<std::size_t>(bits()), "NetworkDecoder: d_logits");
    COMPMARK_ASSERT(context.readings[0].slopes.size() == layers_.size(), "NetworkDecoder: backward after forward");
    const double share = 1 / static_cast<double>(context.parts.count);
    context.d_features.resize(static_cast<std::size_t>(features()));
    std::fill(context.d_features.begin(), context.d_features.end(), 0.0);
    for (std::size_t r = 0; r < d_logits.size(); ++r) {
      const double* const row = head_.matrix.data() + r * context.d_features.size();
      for (std::size_t f = 0; f < context.d_features.size(); ++f)
        context.d_features[f] += share * static_cast<double>(d_logits[r]) * row[f];
    }
    for (std::size_t part = 0; part < context.parts.count; ++part)
      backward(context.readings[part], d_image, context, executor);
  }

 private:
  using Reading = typename Context::Reading;
  struct Layer {
    Kernel<T> convolution;
    bool pool = false;
    bool tap = false;
  };

  /// ADDS to d_image what comes through one part.
  template <class E>
  void backward(Reading& reading, ImageView<T> d_image, Context& context, E& executor) const {
    FeatureMaps<T>* now = &context.maps[0];
    FeatureMaps<T>* next = &context.maps[1];
    std::size_t first = context.d_features.size();  // of the layer's features
    start(first, reading, context, executor);
    for (std::size_t l = layers_.size(); l-- > 1;) {
      const Layer& layer = layers_[l];
      const FeatureView<const T> slope = std::as_const(reading.slopes[l - 1]).view();
      const T share = tap_share(slope);
      if (layers_[l - 1].tap) first -= static_cast<std::size_t>(slope.channels);
      const double* const d_tap = context.d_features.data() + first;
      const bool tap = layers_[l - 1].tap;
      const auto finish = [&](auto value, const ConvPlace<T>& place) {
        using P = decltype(value);
        if (tap) value += P(static_cast<T>(d_tap[place.channel]) * share);
        return value * place.load(slope.data);
      };
      if (!layer.pool) {
        next->resize(slope.channels, slope.height, slope.width, slope.row_stride, slope.plane_stride);
        layer.convolution.backward(std::as_const(*now).view(), next->view(), context.convolution, executor, finish);
      } else {
        next->resize(slope.channels, max_pool_size(slope.height), max_pool_size(slope.width));
        layer.convolution.backward(std::as_const(*now).view(), next->view(), context.convolution, executor,
                                   IdentityFinish{});
        now->resize(slope.channels, slope.height, slope.width, slope.row_stride, slope.plane_stride);
        max_pool_adjoint(std::as_const(*next).view(), reading.choices[l], now->view(), executor);
        apply_finish(now->view(), finish, executor);
        continue;
      }
      std::swap(now, next);
    }
    const Layer& layer = layers_.front();
    next->resize(layer.convolution.shape().in, stem_size(reading.height, stem_), stem_size(reading.width, stem_));
    layer.convolution.backward(std::as_const(*now).view(), next->view(), context.convolution, executor,
                               IdentityFinish{});
    const ImageView<T> d_converted{reading.converted.data(), 3, reading.height, reading.width};
    depth_to_space(std::as_const(*next).view(), stem_, d_converted, executor);
    reading.cut.add(d_image,
                    [&](ImageView<T> d_read) { input_.backward(d_converted, d_read, reading.input, executor); });
  }

  /// Whether a network input of n positions a side leaves every layer one.
  [[nodiscard]] bool fits(int n) const {
    for (const Layer& layer : layers_) {
      if (layer.pool) n = n < 3 ? 0 : max_pool_size(n);
      const ConvShape& s = layer.convolution.shape();
      if (n < 1 || n + 2 * s.padding < s.kernel) return false;
      n = s.output_size(n);
    }
    return true;
  }
  [[nodiscard]] T tap_share(FeatureView<const T> maps) const {
    return static_cast<T>(1 / (static_cast<double>(maps.height) * static_cast<double>(maps.width)));
  }

  template <class E>
  FeatureView<T> run(ImageView<const T> image, std::size_t part, std::span<double> features, Context& context,
                     E& executor, bool raw) const {
    COMPMARK_ASSERT(image.channels == 3, "NetworkDecoder: an RGB image");
    Reading& reading = context.readings[part];
    image = reading.cut.of(image, context.parts.boxes[part]);
    return activation_ == DecoderActivation::gelu
               ? run(image, features, reading, context, executor, raw, detail::GeluActivation{})
               : run(image, features, reading, context, executor, raw, detail::ReluActivation{});
  }
  /// Fills the features and returns the last maps; `raw`: without the last activation.
  template <class E, class Activation>
  FeatureView<T> run(ImageView<const T> image, std::span<double> features, Reading& reading, Context& context,
                     E& executor, bool raw, const Activation& activation) const {
    const auto size = input().output_size(image.height, image.width);
    reading.height = size[0];
    reading.width = size[1];
    COMPMARK_ASSERT(fits(stem_size(std::min(size[0], size[1]), stem_)),
                    "NetworkDecoder: the image is below minimum_size()");
    reading.converted.resize(3 * static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]));
    const ImageView<T> converted{reading.converted.data(), 3, size[0], size[1]};
    input_.forward(image, converted, reading.input, executor);
    if (reading.slopes.size() != layers_.size()) {
      reading.slopes.resize(layers_.size());
      reading.choices.resize(layers_.size());
    }
    FeatureMaps<T>* now = &context.maps[0];  // roles, not contents, are swapped: each buffer is as large in every call
    FeatureMaps<T>* next = &context.maps[1];
    space_to_depth(ImageView<const T>(converted), stem_, *now, executor);
    std::size_t first = 0;
    for (std::size_t l = 0; l < layers_.size(); ++l) {
      const Layer& layer = layers_[l];
      if (layer.pool) {
        max_pool(std::as_const(*now).view(), *next, reading.choices[l], executor);
        std::swap(now, next);
      }
      layer.convolution.prepare(std::as_const(*now).view(), *next, context.convolution, executor);
      const FeatureView<T> output = next->view();
      reading.slopes[l].resize(output.channels, output.height, output.width, output.row_stride, output.plane_stride);
      T* const slopes = reading.slopes[l].view().data;
      const bool linear = raw && l + 1 == layers_.size();
      layer.convolution.forward(output, context.convolution, executor, [&](auto value, const ConvPlace<T>& place) {
        if (linear) return value;
        const auto activated = activation(value);
        place.store(activated.slope, slopes);
        return activated.value;
      });
      if (layer.tap) {
        mean_over_positions(FeatureView<const T>(output),
                            features.subspan(first, static_cast<std::size_t>(output.channels)), executor);
        first += static_cast<std::size_t>(output.channels);
      }
      std::swap(now, next);
    }
    return now->view();
  }

  /// The gradient before the last activation: d mean, the same at all positions, times the slope.
  template <class E>
  void start(std::size_t& first, const Reading& reading, Context& context, E& executor) const {
    const FeatureView<const T> slope = reading.slopes.back().view();
    first -= static_cast<std::size_t>(slope.channels);
    const double* const d_tap = context.d_features.data() + first;
    const T share = tap_share(slope);
    context.maps[0].resize(slope.channels, slope.height, slope.width, slope.row_stride, slope.plane_stride);
    const FeatureView<T> target = context.maps[0].view();
    executor.for_chunks(static_cast<std::size_t>(slope.channels), 1, [&](std::size_t c, std::size_t, std::size_t) {
      const T factor = static_cast<T>(d_tap[c]) * share;
      for (int y = 0; y < slope.height; ++y) {
        const T* const source = slope.row(static_cast<int>(c), y);
        T* const row = target.row(static_cast<int>(c), y);
        for (int x = 0; x < slope.width; ++x) row[x] = factor * source[x];
      }
    });
  }

  /// The finish of a backward convolution over maps that a pooling filled.
  template <class E, class Finish>
  static void apply_finish(FeatureView<T> maps, const Finish& finish, E& executor) {
    using P = Pack<T, native_width<T>>;
    executor.for_chunks(static_cast<std::size_t>(maps.channels), 1, [&](std::size_t channel, std::size_t, std::size_t) {
      const int c = static_cast<int>(channel);
      for (int y = 0; y < maps.height; ++y) {
        for (int x = 0; x < maps.width; x += P::width) {
          const ConvPlace<T> at{c, static_cast<std::size_t>(maps.row(c, y) + x - maps.data),
                                Mask<T, P::width>::first(maps.width - x)};
          at.store(finish(at.load(maps.data), at), maps.data);
        }
      }
    });
  }

  DecoderInput<T> input_;
  int stem_ = 1;
  int minimum_size_ = 1;
  DecoderActivation activation_ = DecoderActivation::gelu;
  double logit_scale_ = 10;
  DecoderHead head_;
  std::vector<Layer> layers_;
};

}  // namespace compmark
