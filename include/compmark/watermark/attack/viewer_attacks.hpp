// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a picture (attack_list.hpp) that viewers, phones and image programs make: a picture is mirrored, put on a
// page, painted over, filtered, stored with fewer levels, photographed from a screen. PictureAttacks
// (picture_attacks.hpp) has them in its list. Cost: some ns a value; sharpening 70, the median 230 (3 x 3) to 4,800
// (15 x 15).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/attack/attack_list.hpp"

namespace compmark {

namespace detail {
[[nodiscard]] inline float colour_of(double value) {
  return value > 0 ? (value < 1 ? static_cast<float>(value) : 1.0f) : 0.0f;
}
/// A picture in the middle of one of another size, of one colour.
[[nodiscard]] inline AttackedPicture picture_on_page(ImageView<const float> image, int height, int width, int top,
                                                     int left, float level) {
  AttackedPicture page{height, width, {}};
  page.planes.assign(3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width), level);
  const ImageView<float> to{page.planes.data(), 3, height, width};
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < image.height; ++y) std::copy_n(image.row(c, y), image.width, to.row(c, y + top) + left);
  }
  return page;
}
/// Each value becomes use(window), a function of those at most `reach` pixels beside it, row by row; beyond an edge
/// those on it are taken. The value itself is the one in the middle.
template <class Use>
[[nodiscard]] AttackedPicture filtered_picture(ImageView<const float> image, int reach, const Use& use) {
  AttackedPicture result{image.height, image.width, std::vector<float>(image.size())};
  const ImageView<float> to{result.planes.data(), 3, image.height, image.width};
  std::vector<float> window;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        window.clear();
        for (int v = y - reach; v <= y + reach; ++v) {
          for (int u = x - reach; u <= x + reach; ++u)
            window.push_back(image(c, std::clamp(v, 0, image.height - 1), std::clamp(u, 0, image.width - 1)));
        }
        to(c, y, x) = use(std::span<float>(window));
      }
    }
  }
  return result;
}
}  // namespace detail

struct ContrastAttack {
  static constexpr std::string_view name = "contrast";
  static constexpr AttackAmount amount{0.8, 0, 4, "the factor of what differs from the mean of the picture"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double factor, std::uint64_t /*seed*/) {
    AttackedPicture result{image.height, image.width, {image.data, image.data + image.size()}};
    double mean = 0;
    for (const float value : result.planes) mean += static_cast<double>(value) / static_cast<double>(image.size());
    for (float& value : result.planes) value = detail::colour_of(mean + factor * (static_cast<double>(value) - mean));
    return result;
  }
};
struct MirrorAttack {
  static constexpr std::string_view name = "mirror";
  static constexpr AttackAmount amount{1, 1, 2, "1 to exchange left and right, 2 for top and bottom", 1};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double axis, std::uint64_t /*seed*/) {
    AttackedPicture result{image.height, image.width, std::vector<float>(image.size())};
    const ImageView<float> to{result.planes.data(), 3, image.height, image.width};
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < image.height; ++y) {
        if (axis < 1.5) {
          std::reverse_copy(image.row(c, y), image.row(c, y) + image.width, to.row(c, y));
        } else {
          std::copy_n(image.row(c, y), image.width, to.row(c, image.height - 1 - y));
        }
      }
    }
    return result;
  }
};
struct MedianAttack {
  static constexpr std::string_view name = "median";
  static constexpr AttackAmount amount{3, 1, 15, "the side of the window in pixels, an odd number", 2};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double side, std::uint64_t /*seed*/) {
    return detail::filtered_picture(image, static_cast<int>(std::lround(side)) / 2, [](std::span<float> window) {
      const auto middle = window.begin() + static_cast<std::ptrdiff_t>(window.size() / 2);
      std::nth_element(window.begin(), middle, window.end());
      return *middle;
    });
  }
};
struct SharpenAttack {
  static constexpr std::string_view name = "sharpen";
  static constexpr AttackAmount amount{1, 0, 10, "how often the difference to the mean of 3 x 3 pixels is added"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double times, std::uint64_t /*seed*/) {
    return detail::filtered_picture(image, 1, [times](std::span<const float> window) {
      const double value = static_cast<double>(window[4]);
      double sum = 0;
      for (const float near : window) sum += static_cast<double>(near);
      return detail::colour_of(value + times * (value - sum / 9));
    });
  }
};
struct LevelsAttack {
  static constexpr std::string_view name = "levels";
  static constexpr AttackAmount amount{5, 1, 8, "the bits that are kept of each channel, a whole number", 1};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double bits, std::uint64_t /*seed*/) {
    AttackedPicture result{image.height, image.width, {image.data, image.data + image.size()}};
    const double most = std::exp2(std::round(bits)) - 1;
    for (float& value : result.planes) value = detail::colour_of(std::round(static_cast<double>(value) * most) / most);
    return result;
  }
};
/// A rectangle of the picture's shape, somewhere in it, in one colour.
struct PaintAttack {
  static constexpr std::string_view name = "paint";
  static constexpr AttackAmount amount{0.2, 0, 0.9, "the share of the area that is painted over"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double share, std::uint64_t seed) {
    AttackedPicture result{image.height, image.width, {image.data, image.data + image.size()}};
    const ImageView<float> to{result.planes.data(), 3, image.height, image.width};
    const Random random(seed, 0, random_stage("attack/paint"));
    const auto part = [&](int side) { return static_cast<int>(std::lround(std::sqrt(share) * side)); };
    const int height = part(image.height), width = part(image.width);
    const int top = static_cast<int>(random.uniform(0) * (image.height - height + 1)),
              left = static_cast<int>(random.uniform(1) * (image.width - width + 1));
    for (int c = 0; c < 3; ++c) {
      const float colour = static_cast<float>(random.uniform(2 + static_cast<std::uint64_t>(c)));
      for (int y = top; y < top + height; ++y) std::fill_n(to.row(c, y) + left, width, colour);
    }
    return result;
  }
};
/// On a page as viewers show it: one third wider and higher, all round, a little out of the middle.
struct PageAttack {
  static constexpr std::string_view name = "page";
  static constexpr AttackAmount amount{0.4, 0, 1, "the grey level of the page, of colours in [0, 1]"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double level, std::uint64_t /*seed*/) {
    const int above = image.height / 4, beside = image.width / 6;
    return detail::picture_on_page(image, image.height + above + image.height / 12,
                                   image.width + beside + image.width / 6, above, beside, static_cast<float>(level));
  }
};

}  // namespace compmark
