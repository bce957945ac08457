// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Edits of colour: exposure, white balance, contrast, saturation down to grey, hue and gamma, as photo programs and
// screens do them. All but gamma and contrast's middle are one matrix a picture:
//   y = clamp(M x + m, 1/255/16, 1),  out = y^gamma,
//   M = contrast * gain * diag(white) * Y^-1 turn(hue) diag(1, saturation, saturation) Y,  m = gain * (1 - contrast) * middle
// with Y from RGB to luma and two differences of colour (YIQ) and middle the mean of the picture. A clamped value has
// no gradient. Cost: ~4 ns a value each way.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/edit/concept.hpp"

namespace compmark {

struct ToneEdit {
  /// Largest changes; factors are drawn between 1 / f and f with an even logarithm.
  struct Settings {
    double gain = 1.4;        ///< factor of exposure
    double white = 1.1;       ///< factor of each channel
    double contrast = 1.3;    ///< factor about the mean
    double gamma = 1.4;       ///< exponent
    double hue = 0.3;         ///< radians
    double saturation = 0.8;  ///< largest loss; the largest gain is half of it
    double grey = 0.15;       ///< share of edits that leave no colour
  };
  struct Draw {
    std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};
    double keep_middle = 0;  ///< share of the mean that is added
    double gamma = 1;
    bool changes = false;
  };
  template <class T>
  struct Context {
    Buffer<T> output, slope;  ///< slope: d out / d (M x + m), 0 where it is clamped
    Buffer<double> sums;      ///< of chunks
  };

  /// The matrix of a gain of each channel, a saturation and a hue.
  [[nodiscard]] static std::array<double, 9> colour_matrix(const std::array<double, 3>& gain, double saturation,
                                                           double hue) {
    constexpr std::array<double, 9> to_yiq{0.299, 0.587, 0.114, 0.596, -0.274, -0.322, 0.211, -0.523, 0.312};
    constexpr std::array<double, 9> to_rgb{1.0, 0.9561706854041451,  0.6214325663465856,
                                           1.0, -0.2726886023301063, -0.6468132370201738,
                                           1.0, -1.1037440821760263, 1.7006230946773062};
    const double c = saturation * std::cos(hue), s = saturation * std::sin(hue);
    const std::array<double, 9> turn{1, 0, 0, 0, c, -s, 0, s, c};
    const auto product = [](const std::array<double, 9>& a, const std::array<double, 9>& b) {
      std::array<double, 9> result{};
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
          for (std::size_t k = 0; k < 3; ++k) result[3 * i + j] += a[3 * i + k] * b[3 * k + j];
        }
      }
      return result;
    };
    std::array<double, 9> matrix = product(to_rgb, product(turn, to_yiq));
    for (std::size_t i = 0; i < 9; ++i) matrix[i] *= gain[i / 3];
    return matrix;
  }

  [[nodiscard]] static Draw draw(const Settings& settings, const Random& random, std::uint64_t first) {
    const auto even = [&](std::uint64_t k, double factor) {
      return std::exp((2 * random.uniform(first + k) - 1) * std::log(factor));
    };
    const double gain = even(0, settings.gain), contrast = even(1, settings.contrast);
    std::array<double, 3> gains{};
    for (std::size_t c = 0; c < 3; ++c) gains[c] = gain * contrast * even(2 + c, settings.white);
    const double u = random.uniform(first + 5);
    double saturation = u < 0.5 ? 1 - 2 * u * settings.saturation : 1 + (u - 0.5) * settings.saturation;
    if (random.uniform(first + 6) < settings.grey) saturation = 0;
    Draw result;
    result.matrix = colour_matrix(gains, saturation, (2 * random.uniform(first + 7) - 1) * settings.hue);
    result.keep_middle = gain * (1 - contrast);
    result.gamma = even(8, settings.gamma);
    result.changes = true;
    return result;
  }

  template <class T, Executor E>
  [[nodiscard]] static ImageView<const T> forward(ImageView<const T> image, const Draw& draw, Context<T>& context,
                                                  E& executor) {
    COMPMARK_ASSERT(image.channels == 3, "ToneEdit: three channels");
    context.output.resize(image.size());
    context.slope.resize(image.size());
    double middle = 0;
    if (draw.keep_middle != 0) {
      for (const T value : image.flat()) middle += static_cast<double>(value);
      middle *= draw.keep_middle / static_cast<double>(image.size());
    }
    std::array<T, 9> m{};
    for (std::size_t i = 0; i < 9; ++i) m[i] = static_cast<T>(draw.matrix[i]);
    const std::size_t plane = image.plane_size();
    const T gamma = static_cast<T>(draw.gamma);
    executor.for_chunks(plane, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = begin; i < end; ++i) {
          const T raw = m[3 * c] * image.data[i] + m[3 * c + 1] * image.data[plane + i] +
                        m[3 * c + 2] * image.data[2 * plane + i] + static_cast<T>(middle);
          const bool inside = raw > static_cast<T>(least) && raw < T(1);
          const T y = inside ? raw : (raw > static_cast<T>(least) ? T(1) : static_cast<T>(least));
          const T out = std::pow(y, gamma);
          context.output[c * plane + i] = out;
          context.slope[c * plane + i] = inside ? gamma * out / y : T(0);
        }
      }
    });
    return {context.output.data(), 3, image.height, image.width};
  }

  template <class T, Executor E>
  static void backward(ImageView<const T> d_output, const Draw& draw, ImageView<T> d_image, Context<T>& context,
                       E& executor) {
    std::array<T, 9> m{};
    for (std::size_t i = 0; i < 9; ++i) m[i] = static_cast<T>(draw.matrix[i]);
    const std::size_t plane = d_image.plane_size();
    T of_middle = T(0);  // what every value gets through the mean
    if (draw.keep_middle != 0) {
      context.sums.resize(chunk_count(d_image.size(), grain));
      executor.for_chunks(d_image.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        double sum = 0;
        for (std::size_t i = begin; i < end; ++i) sum += static_cast<double>(d_output.data[i] * context.slope[i]);
        context.sums[begin / grain] = sum;
      });
      double sum = 0;
      for (const double of_chunk : context.sums) sum += of_chunk;
      of_middle = static_cast<T>(draw.keep_middle * sum / static_cast<double>(d_image.size()));
    }
    executor.for_chunks(plane, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        std::array<T, 3> d{};
        for (std::size_t c = 0; c < 3; ++c) d[c] = d_output.data[c * plane + i] * context.slope[c * plane + i];
        for (std::size_t c = 0; c < 3; ++c) {
          d_image.data[c * plane + i] += m[c] * d[0] + m[3 + c] * d[1] + m[6 + c] * d[2] + of_middle;
        }
      }
    });
  }

 private:
  static constexpr double least = 1.0 / 4080;  // a sixteenth of a step of 8 bits: gamma's slope is finite
  static constexpr std::size_t grain = 1 << 13;
};

static_assert(PictureEdit<ToneEdit>);

}  // namespace compmark
