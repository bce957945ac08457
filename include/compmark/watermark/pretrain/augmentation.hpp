// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Distortions of an image with their gradients, for training a decoder and for embedding with expectation over
// transformations: crop (not resized back), antialiased resize, rotation on the same canvas (bilinear, black corners),
// Gaussian blur, noise and brightness (clamped: a clamped value has no gradient), and JPEG by straight-through, x +
// stop(JPEG(x) - x) (docs/spec/watermark.md, 3). All but JPEG have exact gradients. The codec is the caller's:
// jpeg(image, quality, output), because this folder reads and writes no files. One distortion is drawn an image, from a
// keyed stream. Cost: 1 to 6 ns a value each way; JPEG what the codec takes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/normals.hpp"
#include "compmark/math/separable_map.hpp"
#include "compmark/watermark/pretrain/rotation.hpp"

namespace compmark {

enum class Augmentation : std::uint8_t { none, crop, resize, rotation, blur, noise, brightness, jpeg };
inline constexpr std::size_t augmentation_count = 8;

/// One drawn distortion.
struct AugmentationDraw {
  Augmentation kind = Augmentation::none;
  double amount = 0;  ///< area share, side factor, radians, sigma in pixels, standard deviation, factor, quality
  double top = 0.5;   ///< place of a crop, 0 ... 1 of what is free
  double left = 0.5;
  std::uint64_t seed = 0;  ///< of noise
};

/// Ranges to draw from, and how often each kind is drawn (in the order of the enumeration).
struct AugmentationSettings {
  std::array<double, augmentation_count> weight{1, 1, 1, 1, 1, 1, 1, 1};
  std::array<double, 2> crop_area{0.25, 0.9};
  std::array<double, 2> resize_side{0.6, 1.1};
  double largest_rotation = std::numbers::pi / 6;  ///< radians
  std::array<double, 2> blur_sigma{0.5, 2};
  std::array<double, 2> noise_deviation{0.01, 0.1};
  std::array<double, 2> brightness{0.7, 1.3};
  std::array<double, 2> jpeg_quality{40, 90};
};

/// Nothing but the image itself.
[[nodiscard]] inline AugmentationSettings no_augmentation() {
  AugmentationSettings settings;
  settings.weight = {1, 0, 0, 0, 0, 0, 0, 0};
  return settings;
}

/// Uses the indices first ... first + 5 of the stream.
[[nodiscard]] inline AugmentationDraw draw_augmentation(const AugmentationSettings& settings, const Random& random,
                                                        std::uint64_t first = 0) {
  double total = 0;
  for (const double w : settings.weight) total += w;
  double at = random.uniform(first) * total;
  std::size_t kind = 0;
  while (kind + 1 < augmentation_count && at >= settings.weight[kind]) at -= settings.weight[kind++];
  while (kind > 0 && settings.weight[kind] == 0) --kind;  // rounding at the last one
  AugmentationDraw draw;
  draw.kind = static_cast<Augmentation>(kind);
  const double u = random.uniform(first + 1);
  const auto between = [u](const std::array<double, 2>& range) { return range[0] + u * (range[1] - range[0]); };
  switch (draw.kind) {
    case Augmentation::none:
      break;
    case Augmentation::crop:
      draw.amount = between(settings.crop_area);
      break;
    case Augmentation::resize:
      draw.amount = between(settings.resize_side);
      break;
    case Augmentation::rotation:
      draw.amount = (2 * u - 1) * settings.largest_rotation;
      break;
    case Augmentation::blur:
      draw.amount = between(settings.blur_sigma);
      break;
    case Augmentation::noise:
      draw.amount = between(settings.noise_deviation);
      break;
    case Augmentation::brightness:
      draw.amount = between(settings.brightness);
      break;
    case Augmentation::jpeg:
      draw.amount = std::round(between(settings.jpeg_quality));
      break;
  }
  draw.top = random.uniform(first + 2);
  draw.left = random.uniform(first + 3);
  draw.seed = random.bits(first + 4);
  return draw;
}

/// Applies a draw and takes gradients back. One object an image in flight; grow-only but for the tables of a new size.
template <class T>
class Augmenter {
 public:
  /// The distorted image; it lives until the next forward.
  template <Executor E, class Jpeg>
  [[nodiscard]] ImageView<const T> forward(ImageView<const T> image, const AugmentationDraw& draw, const Jpeg& jpeg,
                                           E& executor) {
    draw_ = draw;
    height_ = image.height;
    width_ = image.width;
    const auto side = [](double n) { return std::max(1, static_cast<int>(std::lround(n))); };
    switch (draw.kind) {
      case Augmentation::crop: {
        const double factor = std::sqrt(draw.amount);
        const int h = side(factor * image.height), w = side(factor * image.width);
        const auto place = [](double at, int free) { return std::min(free, static_cast<int>(at * (free + 1))); };
        map_ = {RunTable<T>::crop(image.height, place(draw.top, image.height - h), h),
                RunTable<T>::crop(image.width, place(draw.left, image.width - w), w)};
        break;
      }
      case Augmentation::resize:
        map_ = {RunTable<T>::resize(image.height, side(draw.amount * image.height)),
                RunTable<T>::resize(image.width, side(draw.amount * image.width))};
        break;
      case Augmentation::blur:
        map_ = {RunTable<T>::gaussian(image.height, draw.amount), RunTable<T>::gaussian(image.width, draw.amount)};
        break;
      default:
        break;
    }
    const ImageView<T> output =
        shape(image, separable() ? map_.height() : image.height, separable() ? map_.width() : image.width);
    if (separable()) {
      map_.apply(image, output, scratch_, executor);
    } else if (draw.kind == Augmentation::rotation) {
      rotate_image(image, draw.amount, output, executor);
    } else if (draw.kind == Augmentation::jpeg) {
      jpeg(image, static_cast<int>(draw.amount), output);
    } else {
      const Random random(draw.seed, 0, random_stage("mark/pretrain/noise"));
      const bool noise = draw.kind == Augmentation::noise, bright = draw.kind == Augmentation::brightness;
      executor.for_chunks(image.size(), std::size_t{1} << 13, [&](std::size_t begin, std::size_t end, std::size_t) {
        std::array<double, 256> normals{};
        for (std::size_t from = begin; from < end; from += normals.size()) {
          const std::size_t count = std::min(normals.size(), end - from);
          if (noise) fill_normals(random, from, std::span<double>(normals).first(count));
          for (std::size_t i = 0; i < count; ++i) {
            T value = image.data[from + i];
            if (noise) value += static_cast<T>(draw.amount * normals[i]);
            if (bright) value *= static_cast<T>(draw.amount);
            output.data[from + i] = noise || bright ? std::clamp(value, T(0), T(1)) : value;
          }
        }
      });
    }
    return output;
  }

  /// Adds the gradient behind the distortion, carried back, to d_image.
  template <Executor E>
  void backward(ImageView<const T> d_output, ImageView<T> d_image, E& executor) {
    COMPMARK_ASSERT(d_image.height == height_ && d_image.width == width_, "Augmenter: the image of forward");
    if (separable()) {
      map_.add_transposed(d_output, d_image, scratch_, executor);
      return;
    }
    if (draw_.kind == Augmentation::rotation) {
      add_rotation_transposed(d_output, draw_.amount, d_image);
      return;
    }
    const bool clamped = draw_.kind == Augmentation::noise || draw_.kind == Augmentation::brightness;
    const T factor = draw_.kind == Augmentation::brightness ? static_cast<T>(draw_.amount) : T(1);
    executor.for_chunks(d_image.size(), std::size_t{1} << 14, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        if (clamped && !(output_[i] > T(0) && output_[i] < T(1))) continue;
        d_image.data[i] += factor * d_output.data[i];
      }
    });
  }

 private:
  [[nodiscard]] bool separable() const {
    return draw_.kind == Augmentation::crop || draw_.kind == Augmentation::resize || draw_.kind == Augmentation::blur;
  }
  [[nodiscard]] ImageView<T> shape(ImageView<const T> image, int height, int width) {
    output_.resize(static_cast<std::size_t>(image.channels) * static_cast<std::size_t>(height) *
                   static_cast<std::size_t>(width));
    return {output_.data(), image.channels, height, width};
  }

  AugmentationDraw draw_;
  SeparableMap<T> map_;
  PerWorkerRows<T> scratch_;
  Buffer<T> output_;
  int height_ = 0;
  int width_ = 0;
};

}  // namespace compmark
