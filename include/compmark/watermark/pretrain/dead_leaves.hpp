// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Images from formulas, to train and to whiten a decoder without anybody's photographs: dead leaves (shapes with radii
// of density r^-3 that occlude one another, whose edges and spectrum are those of photographs: Lee, Mumford and Huang,
// Int. J. Computer Vision 41, 2001), coloured around a palette, flat, shaded, or textured with 1/f noise or gratings,
// under a gradient of light, slightly blurred. An image is a function of (seed, index). Cost: ~5 ms for 256 x 256.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/separable_map.hpp"

namespace compmark {

namespace detail {

/// Sum of bilinear value noise over octaves, amplitude in proportion to the wavelength: a 1/f spectrum, roughly within
/// [-1, 1].
class OctaveNoise {
 public:
  explicit OctaveNoise(const Random& random, std::uint64_t first) : random_(random), first_(first) {}

  [[nodiscard]] float operator()(float x, float y) const {
    float sum = 0, amplitude = 0.5f, wavelength = 48;
    for (std::uint64_t octave = 0; octave < 5; ++octave, amplitude *= 0.55f, wavelength *= 0.5f) {
      const float u = x / wavelength + 1000, v = y / wavelength + 1000;  // positive
      const auto i = static_cast<std::uint64_t>(u), j = static_cast<std::uint64_t>(v);
      const float fu = u - static_cast<float>(i), fv = v - static_cast<float>(j);
      const auto at = [&](std::uint64_t a, std::uint64_t b) {
        return 2 * random_.centered(first_ + ((octave << 36) | (a << 18) | b));
      };
      sum += amplitude * ((1 - fu) * ((1 - fv) * at(i, j) + fv * at(i, j + 1)) +
                          fu * ((1 - fv) * at(i + 1, j) + fv * at(i + 1, j + 1)));
    }
    return sum;
  }

 private:
  Random random_;
  std::uint64_t first_;
};

}  // namespace detail

/// Fills an RGB image in [0, 1].
inline void dead_leaves_image(std::uint64_t seed, std::uint64_t index, ImageView<float> image) {
  const Random random(seed, index, random_stage("mark/pretrain/dead_leaves"));
  std::uint64_t next = 0;
  const auto uniform = [&] { return static_cast<float>(random.uniform(next++)); };
  const auto normal = [&] { return static_cast<float>(random.normal(next++)); };
  const detail::OctaveNoise noise(random, std::uint64_t{1} << 60);
  const std::array<float, 3> tint{0.08f * normal(), 0.05f * normal(), 0.08f * normal()};
  const float level = 0.15f + 0.6f * uniform(), spread = 0.05f + 0.2f * uniform(), chroma = 0.01f + 0.07f * uniform();
  const float smallest = 3 + 25 * uniform() * uniform(), largest = 0.6f * static_cast<float>(image.width);
  std::vector<std::uint8_t> covered(image.plane_size(), 0);
  std::size_t left = image.plane_size();

  for (int leaf = 0; leaf < 1500 && left > 0; ++leaf) {
    const bool background = leaf == 1499;
    const float u = uniform();  // density r^-3 between the two radii
    const float inverse = (1 - u) / (smallest * smallest) + u / (largest * largest);
    const float radius = background ? 1e6f : 1 / std::sqrt(inverse);
    const float cx = uniform() * static_cast<float>(image.width), cy = uniform() * static_cast<float>(image.height);
    const float angle = 2 * std::numbers::pi_v<float> * uniform(), stretch = 0.5f + uniform();
    const float ca = std::cos(angle), sa = std::sin(angle);
    const bool square = uniform() < 0.4f;
    std::array<float, 3> colour;
    const float light = std::clamp(level + spread * normal(), 0.04f, 0.92f);
    for (std::size_t c = 0; c < 3; ++c) colour[c] = light + tint[c] + chroma * normal();
    const float kind = uniform(), strength = 0.02f + 0.15f * uniform() * uniform();
    const float frequency = 0.02f + 0.3f * uniform() * uniform(), shade = 0.3f * (uniform() - 0.5f);
    const float offset_x = 500 * uniform(), offset_y = 500 * uniform(), zoom = 0.5f + 2 * uniform();

    const float reach = radius * 1.5f;
    const int y0 = std::max(0, static_cast<int>(cy - reach)), x0 = std::max(0, static_cast<int>(cx - reach));
    const int y1 = static_cast<int>(std::min(static_cast<float>(image.height), cy + reach + 1));
    const int x1 = static_cast<int>(std::min(static_cast<float>(image.width), cx + reach + 1));
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        std::uint8_t& taken = covered[static_cast<std::size_t>(y * image.width + x)];
        if (taken != 0) continue;
        const float dx = static_cast<float>(x) - cx, dy = static_cast<float>(y) - cy;
        const float a = (ca * dx + sa * dy) / radius, b = (ca * dy - sa * dx) / (radius * stretch);
        if (square ? std::max(std::abs(a), std::abs(b)) > 0.8f : a * a + b * b > 1) continue;
        taken = 1;
        --left;
        float value = background ? 0 : shade * a;
        if (kind < 0.45f) {
          value +=
              strength * 2 * noise(static_cast<float>(x) * zoom + offset_x, static_cast<float>(y) * zoom + offset_y);
        } else if (kind < 0.58f) {
          value += strength * std::sin(2 * std::numbers::pi_v<float> * frequency * (ca * dx + sa * dy));
        }
        for (std::size_t c = 0; c < 3; ++c) image(static_cast<int>(c), y, x) = colour[c] * (1 + 2 * value);
      }
    }
  }

  const float tilt_x = 0.5f * (uniform() - 0.5f), tilt_y = 0.5f * (uniform() - 0.5f), grain = 0.012f * uniform();
  std::uint64_t grain_index = std::uint64_t{1} << 50;
  for (int c = 0; c < image.channels; ++c) {
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const float lamp = 1 + tilt_x * (static_cast<float>(x) / static_cast<float>(image.width) - 0.5f) +
                           tilt_y * (static_cast<float>(y) / static_cast<float>(image.height) - 0.5f);
        image(c, y, x) = image(c, y, x) * lamp + grain * 3.4f * random.centered(grain_index++);
      }
    }
  }
  const SeparableMap<float> blur{RunTable<float>::gaussian(image.height, 0.4 + 0.6 * static_cast<double>(uniform())),
                                 RunTable<float>::gaussian(image.width, 0.6)};
  std::vector<float> sharp(image.data, image.data + image.size());
  PerWorkerRows<float> scratch;
  SerialExecutor executor;
  blur.apply({sharp.data(), image.channels, image.height, image.width}, image, scratch, executor);
  for (float& value : image.flat()) value = std::clamp(value, 0.0f, 1.0f);
}

}  // namespace compmark
