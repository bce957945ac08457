// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Learned perceptual image patch similarity, v0.1 (Zhang et al., CVPR 2018), with the AlexNet or SqueezeNet 1.1
// backbone:
//   d(x, y) = sum over layers of mean over pixels of sum_c w_c (fx_c / (|fx| + 1e-10) - fy_c / (|fy| + 1e-10))^2.
// Weights come from a tensor file the user gives; none are shipped. Networks see (2 v - 1 - shift) / scale for v in [0,
// 1]; the splatting family passes v itself where 2 v - 1 belongs, which InputRange::family_unit reproduces
// (docs/spec/watermark.md, 6). Figures of different backbones are not comparable. Cost: 9.1 GMAC an image of 800 x 800
// for AlexNet.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/conv.hpp"

namespace compmark {

enum class LpipsNetwork { alex, squeeze };
enum class LpipsRange {
  signed_unit,  ///< images are mapped to [-1, 1] first, as the networks were calibrated
  /// images in [0, 1] are passed as they are, as published splatting results were (not the calibrated metric)
  family_unit,
};

struct LpipsReport {
  double value = 0;
  std::vector<double> layers;  ///< the summands, shallow to deep
};

class Lpips {
 public:
  struct Context {
    ConvInput<float> packed;
    ConvScratch<float> convolution;
    std::array<std::array<FeatureMaps<float>, 2>, 2> maps;  ///< [image][front, back]
    FeatureMaps<float> squeezed;
    PerWorkerRows<float> rows;
    Buffer<double> partial;
  };

  /// Builds the network from named tensors (OIHW). `TensorFile` is SafetensorsFile, or anything with has(name) and
  /// floats(name, shape).
  template <class TensorFile>
  [[nodiscard]] static Result<Lpips> load(const TensorFile& file) {
    Lpips net;
    net.network_ = file.has("features.fire2.squeeze1x1.weight") ? LpipsNetwork::squeeze : LpipsNetwork::alex;
    Error error;
    bool failed = false;
    const auto convolution = [&](const std::string& name, const ConvShape& shape) {
      auto weight = file.floats("features." + name + ".weight", {shape.out, shape.in, shape.kernel, shape.kernel});
      auto bias = file.floats("features." + name + ".bias", {shape.out});
      for (const auto* part : {&weight, &bias}) {
        if (!*part && !failed) {
          failed = true;
          error = part->error();
          error.remedy =
              "give an LPIPS v0.1 file: AlexNet or SqueezeNet 1.1 features and lin weights as safetensors, layout OIHW";
        }
      }
      if (!failed) net.convolutions_.emplace_back(shape, *weight, *bias);
    };
    std::vector<int> tapped;
    if (net.network_ == LpipsNetwork::alex) {
      convolution("conv1", {3, 64, 11, 4, 2});
      convolution("conv2", {64, 192, 5, 1, 2});
      convolution("conv3", {192, 384, 3, 1, 1});
      convolution("conv4", {384, 256, 3, 1, 1});
      convolution("conv5", {256, 256, 3, 1, 1});
      tapped = {64, 192, 384, 256, 256};
    } else {
      convolution("conv1", {3, 64, 3, 2, 0});
      int in = 64;
      for (int fire = 2; fire <= 9; ++fire) {
        const std::string name = "fire" + std::to_string(fire);
        const int squeezed = 16 * (fire / 2);  // 16 16 32 32 48 48 64 64
        convolution(name + ".squeeze1x1", {in, squeezed, 1, 1, 0});
        convolution(name + ".expand1x1", {squeezed, 4 * squeezed, 1, 1, 0});
        convolution(name + ".expand3x3", {squeezed, 4 * squeezed, 3, 1, 1});
        in = 8 * squeezed;
      }
      tapped = {64, 128, 256, 384, 384, 512, 512};
    }
    for (std::size_t layer = 0; layer < tapped.size() && !failed; ++layer) {
      auto weights = file.floats("lin" + std::to_string(layer) + ".weight", {tapped[layer]});
      if (!weights) return weights.error();
      net.linear_.push_back(std::move(*weights));
    }
    if (failed) return error;
    return net;
  }

  [[nodiscard]] LpipsNetwork network() const { return network_; }
  /// Smaller images leave a layer without a pixel.
  [[nodiscard]] int smallest_image() const { return network_ == LpipsNetwork::alex ? 31 : 17; }

  /// Distance of two RGB images in [0, 1] of one shape (round them first, rounding.hpp). 0 for identical images.
  template <Executor E>
  [[nodiscard]] Result<LpipsReport> distance(ImageView<const float> image, ImageView<const float> reference,
                                             Context& context, E& executor,
                                             LpipsRange range = LpipsRange::signed_unit) const {
    COMPMARK_ASSERT(image.channels == 3 && reference.channels == 3 && image.height == reference.height &&
                        image.width == reference.width,
                    "Lpips: two RGB images of one shape");
    if (std::min(image.height, image.width) < smallest_image()) {
      return Error{ErrorKind::invalid, "", "image size",
                   std::to_string(image.width) + " x " + std::to_string(image.height) + " is too small for LPIPS",
                   "use images of at least " + std::to_string(smallest_image()) + " pixels a side"};
    }
    normalise(image, range, context.maps[0][0], executor);
    normalise(reference, range, context.maps[1][0], executor);
    LpipsReport report;
    if (network_ == LpipsNetwork::alex) {
      for (std::size_t layer = 0; layer < 5; ++layer) {
        for (auto& maps : context.maps) {
          if (layer == 1 || layer == 2) pool(maps, false, executor);
          apply(convolutions_[layer], maps, context, executor);
        }
        compare(layer, report, context, executor);
      }
    } else {
      for (auto& maps : context.maps) apply(convolutions_[0], maps, context, executor);
      compare(0, report, context, executor);
      std::size_t tap = 1;
      for (std::size_t fire = 2; fire <= 9; ++fire) {
        for (auto& maps : context.maps) {
          if (fire == 2 || fire == 4 || fire == 6) pool(maps, true, executor);
          apply_fire(3 * (fire - 2) + 1, maps, context, executor);
        }
        if (fire != 2 && fire != 4) compare(tap++, report, context, executor);  // taps: fire 3, 5, 6, 7, 8, 9
      }
    }
    for (const double layer : report.layers) report.value += layer;
    return report;
  }

 private:
  using Maps = std::array<FeatureMaps<float>, 2>;

  template <class E>
  static void normalise(ImageView<const float> image, LpipsRange range, FeatureMaps<float>& maps, E& executor) {
    constexpr std::array<float, 3> shift{-0.030f, -0.088f, -0.188f};
    constexpr std::array<float, 3> scale{0.458f, 0.448f, 0.450f};
    maps.resize(3, image.height, image.width);
    const FeatureView<float> target = maps.view();
    executor.for_chunks(3, 1, [&](std::size_t c, std::size_t, std::size_t) {
      for (int y = 0; y < image.height; ++y) {
        const float* source = image.row(static_cast<int>(c), y);
        float* row = target.row(static_cast<int>(c), y);
        for (int x = 0; x < image.width; ++x) {
          const float value = range == LpipsRange::signed_unit ? 2 * source[x] - 1 : source[x];
          row[x] = (value - shift[c]) / scale[c];
        }
      }
    });
  }

  template <class E>
  static void pool(Maps& maps, bool ceil, E& executor) {
    max_pool_3x3_stride_2<float>(std::as_const(maps[0]).view(), ceil, maps[1], executor);
    std::swap(maps[0], maps[1]);
  }
  template <class E>
  static void apply(const Convolution<float>& convolution, Maps& maps, Context& context, E& executor) {
    context.packed.pack(std::as_const(maps[0]).view(), convolution.shape().stride, convolution.shape().padding,
                        executor);
    convolution.resize_output(context.packed, maps[1]);
    convolution.forward(context.packed, maps[1].view(), context.convolution, executor, ReluFinish{});
    std::swap(maps[0], maps[1]);
  }
  /// squeeze 1 x 1, then expand 1 x 1 and 3 x 3 side by side; the two expansions share one padded copy.
  template <class E>
  void apply_fire(std::size_t first, Maps& maps, Context& context, E& executor) const {
    const Convolution<float>& squeeze = convolutions_[first];
    const Convolution<float>& narrow = convolutions_[first + 1];
    const Convolution<float>& wide = convolutions_[first + 2];
    context.packed.pack(std::as_const(maps[0]).view(), 1, 0, executor);
    squeeze.resize_output(context.packed, context.squeezed);
    squeeze.forward(context.packed, context.squeezed.view(), context.convolution, executor, ReluFinish{});
    context.packed.pack(std::as_const(context.squeezed).view(), 1, 1, executor);
    wide.resize_output(context.packed, maps[1], narrow.shape().out + wide.shape().out);
    const FeatureView<float> output = maps[1].view();
    narrow.forward(context.packed, output.channel_range(0, narrow.shape().out), context.convolution, executor,
                   ReluFinish{});
    wide.forward(context.packed, output.channel_range(narrow.shape().out, wide.shape().out), context.convolution,
                 executor, ReluFinish{});
    std::swap(maps[0], maps[1]);
  }

  /// Appends one layer's summand. Sums over channels in float along rows, over rows in double and in order.
  template <class E>
  void compare(std::size_t layer, LpipsReport& report, Context& context, E& executor) const {
    const FeatureView<const float> a = std::as_const(context.maps[0][0]).view();
    const FeatureView<const float> b = std::as_const(context.maps[1][0]).view();
    const std::vector<float>& weights = linear_[layer];
    const std::size_t width = static_cast<std::size_t>(a.width);
    context.rows.resize(executor.concurrency(), 3 * width);
    context.partial.resize(static_cast<std::size_t>(a.height));
    const double sum = [&] {
      executor.for_chunks(static_cast<std::size_t>(a.height), 1, [&](std::size_t y, std::size_t, std::size_t worker) {
        float* const inverse_a = context.rows.row(worker);
        float* const inverse_b = inverse_a + width;
        float* const distance = inverse_b + width;
        std::fill_n(inverse_a, 3 * width, 0.0f);
        const int row = static_cast<int>(y);
        for (int c = 0; c < a.channels; ++c) {
          const float* fa = a.row(c, row);
          const float* fb = b.row(c, row);
          for (std::size_t x = 0; x < width; ++x) {
            inverse_a[x] += fa[x] * fa[x];
            inverse_b[x] += fb[x] * fb[x];
          }
        }
        for (std::size_t x = 0; x < width; ++x) {
          inverse_a[x] = 1 / (std::sqrt(inverse_a[x]) + 1e-10f);
          inverse_b[x] = 1 / (std::sqrt(inverse_b[x]) + 1e-10f);
        }
        for (int c = 0; c < a.channels; ++c) {
          const float* fa = a.row(c, row);
          const float* fb = b.row(c, row);
          const float weight = weights[static_cast<std::size_t>(c)];
          for (std::size_t x = 0; x < width; ++x) {
            // In this form equal features give exactly 0, whatever the compiler fuses.
            const float d = fa[x] * (inverse_a[x] - inverse_b[x]) + (fa[x] - fb[x]) * inverse_b[x];
            distance[x] += weight * d * d;
          }
        }
        double row_sum = 0;
        for (std::size_t x = 0; x < width; ++x) row_sum += static_cast<double>(distance[x]);
        context.partial[y] = row_sum;
      });
      double total = 0;
      for (const double row_sum : context.partial) total += row_sum;
      return total;
    }();
    report.layers.push_back(sum / (static_cast<double>(a.height) * static_cast<double>(a.width)));
  }

  LpipsNetwork network_ = LpipsNetwork::alex;
  std::vector<Convolution<float>> convolutions_;
  std::vector<std::vector<float>> linear_;
};

}  // namespace compmark
