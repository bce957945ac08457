// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/tone.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

using namespace compmark;

TEST_CASE("decoder/tone: gains and offsets are as wide as was asked for, and half of that is common to the channels") {
  constexpr int draws = 20000;
  constexpr double deviation = 0.01;
  double gain[3] = {}, square[3] = {}, offset_square = 0, product = 0;
  for (int n = 0; n < draws; ++n) {
    const Random random(3, static_cast<std::uint64_t>(n), random_stage("test tone"));
    const Tone<double> tone = drawn_tone<double>(deviation, random);
    for (std::size_t c = 0; c < 3; ++c) {
      gain[c] += (tone.gain[c] - 1) / draws;
      square[c] += (tone.gain[c] - 1) * (tone.gain[c] - 1) / draws;
      offset_square += tone.offset[c] * tone.offset[c] / (3 * draws);
    }
    product += (tone.gain[0] - 1) * (tone.gain[2] - 1) / draws;
  }
  // Five deviations of a mean, of a variance and of a product of so many draws.
  const double variance = deviation * deviation, wide = 5 * variance * std::sqrt(2.0 / draws);
  for (std::size_t c = 0; c < 3; ++c) {
    CHECK(std::abs(gain[c]) < 5 * deviation / std::sqrt(draws));
    CHECK(std::abs(square[c] - variance) < wide);
  }
  CHECK(std::abs(offset_square - variance / 4) < wide / 4);
  CHECK(std::abs(product - variance / 2) < wide);
}

TEST_CASE("decoder/tone: an image in another light is a line of each channel between black and white") {
  const std::vector<float> image = {0, 0.25f, 0.5f, 1, 0, 0.25f, 0.5f, 1, 0, 0.25f, 0.5f, 1};
  std::vector<float> toned(image.size());
  const ImageView<const float> from{image.data(), 3, 2, 2};
  const Tone<float> tone{{1, 2, 0.5f}, {0, -0.25f, 0.25f}};
  apply_tone<float>(tone, from, {toned.data(), 3, 2, 2});
  CHECK(toned == std::vector<float>{0, 0.25f, 0.5f, 1, 0, 0.25f, 0.75f, 1, 0.25f, 0.375f, 0.5f, 0.75f});
  // In place, and nothing at all by default.
  std::vector<float> same = image;
  apply_tone<float>({}, {same.data(), 3, 2, 2}, {same.data(), 3, 2, 2});
  CHECK(same == image);
  apply_tone<float>(tone, {same.data(), 3, 2, 2}, {same.data(), 3, 2, 2});
  CHECK(same == toned);
}
