// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a picture (attack_list.hpp) by how it is stored: in a palette, as GIF files are, or smaller and enlarged
// again. PictureAttacks (picture_attacks.hpp) has them in its list. Cost: a sort of the pixels for each halving of the
// colours; some ns a value.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string_view>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/separable_map.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/attack/picture_distortion.hpp"

namespace compmark {

/// Median cut (Heckbert 1982): the box of pixels that is widest in a channel, times the pixels in it, is cut at its
/// median there, until there are as many as colours; each pixel has the mean of its box. No dithering.
struct PaletteAttack {
  static constexpr std::string_view name = "palette";
  static constexpr AttackAmount amount{256, 2, 256, "the colours that are left, a whole number", 1};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double colours, std::uint64_t /*seed*/) {
    AttackedPicture result{image.height, image.width, {image.data, image.data + image.size()}};
    const std::size_t plane = image.plane_size();
    std::vector<std::size_t> pixels(plane);
    std::iota(pixels.begin(), pixels.end(), std::size_t{0});
    std::vector<Box> boxes{box_of(image, pixels, 0, plane)};
    while (boxes.size() < static_cast<std::size_t>(std::lround(colours))) {
      const auto widest = std::max_element(boxes.begin(), boxes.end(),
                                           [](const Box& a, const Box& b) { return a.worth() < b.worth(); });
      if (!(widest->width > 0)) break;  // no box has two colours
      const Box cut = *widest;
      const float* const channel = image.data + cut.channel * plane;
      const auto at = [&](std::size_t n) { return pixels.begin() + static_cast<std::ptrdiff_t>(n); };
      std::sort(at(cut.begin), at(cut.end), [&](std::size_t a, std::size_t b) {
        return channel[a] != channel[b] ? channel[a] < channel[b] : a < b;
      });
      const std::size_t middle = cut.begin + (cut.end - cut.begin) / 2;
      *widest = box_of(image, pixels, cut.begin, middle);
      boxes.push_back(box_of(image, pixels, middle, cut.end));
    }
    for (const Box& box : boxes) {
      for (std::size_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (std::size_t n = box.begin; n < box.end; ++n) sum += static_cast<double>(image.data[c * plane + pixels[n]]);
        const auto mean = static_cast<float>(sum / static_cast<double>(box.end - box.begin));
        for (std::size_t n = box.begin; n < box.end; ++n) result.planes[c * plane + pixels[n]] = mean;
      }
    }
    return result;
  }

 private:
  /// Pixels begin to end of the order, and the channel in which they differ most.
  struct Box {
    std::size_t begin = 0, end = 0, channel = 0;
    double width = 0;
    [[nodiscard]] double worth() const { return width * static_cast<double>(end - begin); }
  };
  [[nodiscard]] static Box box_of(ImageView<const float> image, const std::vector<std::size_t>& pixels,
                                  std::size_t begin, std::size_t end) {
    Box box{begin, end};
    for (std::size_t c = 0; c < 3; ++c) {
      const float* const channel = image.data + c * image.plane_size();
      float low = channel[pixels[begin]], high = low;
      for (std::size_t n = begin; n < end; ++n) {
        low = std::min(low, channel[pixels[n]]);
        high = std::max(high, channel[pixels[n]]);
      }
      if (const double width = static_cast<double>(high) - static_cast<double>(low); width > box.width) {
        box.width = width;
        box.channel = c;
      }
    }
    return box;
  }
};

/// Made smaller and enlarged to its size again.
struct ResampleAttack {
  static constexpr std::string_view name = "resample";
  static constexpr AttackAmount amount{0.5, 0.1, 1, "the factor of the sides, before they are as long as before"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double factor, std::uint64_t seed) {
    const AttackedPicture small = detail::distorted_picture(Augmentation::resize, image, factor, seed);
    AttackedPicture result{image.height, image.width, std::vector<float>(image.size())};
    const SeparableMap<float> larger{RunTable<float>::resize(small.height, image.height),
                                     RunTable<float>::resize(small.width, image.width)};
    PerWorkerRows<float> scratch;
    SerialExecutor executor;
    larger.apply(small.view(), ImageView<float>{result.planes.data(), 3, image.height, image.width}, scratch, executor);
    for (float& value : result.planes) value = std::clamp(value, 0.0f, 1.0f);
    return result;
  }
};

}  // namespace compmark
