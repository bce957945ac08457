// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/attack/field_attacks.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "compmark/watermark/attack/picture_attacks.hpp"
#include "support/decoder.hpp"

namespace field_attacks_test {
namespace {

using namespace compmark;

struct Picture {
  std::vector<float> pixels = testing::random_image<float>(40, 50);
  ImageView<const float> view{pixels.data(), 3, 40, 50};
};
AttackedPicture attacked(const Picture& picture, const std::string& text, std::uint64_t seed = 0) {
  auto result = attack_picture<PictureAttacks>(text, picture.view, seed);
  REQUIRE(result.ok());
  return std::move(*result);
}

}  // namespace

TEST_CASE("attack/field_attacks: names of the field's code mean less than the words of its papers") {
  Picture picture;
  for (float& value : picture.pixels) value = 0.3f + 0.4f * value;  // noise is not clamped then
  CHECK(attacked(picture, "field_noise:0.1").planes == attacked(picture, "noise:0.01").planes);
  double squares = 0;
  const AttackedPicture noisy = attacked(picture, "field_noise:0.1");
  for (std::size_t i = 0; i < noisy.planes.size(); ++i)
    squares += std::pow(static_cast<double>(noisy.planes[i] - picture.pixels[i]), 2);
  CHECK(std::sqrt(squares / static_cast<double>(noisy.planes.size())) == doctest::Approx(0.01).epsilon(0.05));

  const AttackedPicture crop = attacked(picture, "field_crop:0.4"), words = attacked(picture, "crop:0.4");
  CHECK((crop.height == 16 && crop.width == 20));
  CHECK((words.height == 25 && words.width == 32));
  const AttackedPicture small = attacked(picture, "field_scale:0.75"), sides = attacked(picture, "resize:0.75");
  CHECK((small.height == 35 && small.width == 43));
  CHECK((sides.height == 30 && sides.width == 38));
}

TEST_CASE("attack/field_attacks: the published blur of .1 changes nothing, that of .8 does") {
  const Picture picture;
  CHECK(attacked(picture, "field_blur:0.1").planes == picture.pixels);
  const AttackedPicture soft = attacked(picture, "field_blur:0.8");
  CHECK(soft.planes != picture.pixels);
  // Nine taps, by hand, at a place inside.
  const double tap = std::exp(-0.5 / 0.64);
  double sum = 0, weight = 0;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      const double w = std::pow(tap, v * v + u * u);
      sum += w * static_cast<double>(picture.view(1, 12 + v, 9 + u));
      weight += w;
    }
  }
  CHECK(static_cast<double>(soft.view()(1, 12, 9)) == doctest::Approx(sum / weight).epsilon(1e-6));
}

TEST_CASE("attack/field_attacks: a rotation is of nearest pixels with black corners, by an angle of the seed") {
  const Picture picture;
  CHECK(attacked(picture, "field_rotation:0").planes == picture.pixels);
  const AttackedPicture once = attacked(picture, "field_rotation:30", 1);
  CHECK((once.height == 40 && once.width == 50));
  CHECK(attacked(picture, "field_rotation:30", 1).planes == once.planes);
  CHECK(attacked(picture, "field_rotation:30", 2).planes != once.planes);
  std::size_t black = 0, kept = 0;
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 50; ++x) {
      const float value = once.view()(0, y, x);
      black += value == 0 ? 1 : 0;
      bool is_one = false;
      for (std::size_t i = 0; i < 2000 && !is_one; ++i) is_one = picture.pixels[i] == value;
      kept += is_one ? 1 : 0;
    }
  }
  CHECK(black > 0);
  CHECK(kept + black >= 2000);  // no value was made
  // Positive angles turn counter-clockwise, as the shipped rotation does.
  AttackedPicture marked{40, 50, std::vector<float>(6000)};
  for (int c = 0; c < 3; ++c) {
    for (int y = 18; y < 22; ++y) {
      for (int x = 38; x < 46; ++x) marked.planes[static_cast<std::size_t>((c * 40 + y) * 50 + x)] = 1;
    }
  }
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    const Random random(seed, 0, random_stage("attack/field_rotation"));
    const double angle = (2 * random.uniform(0) - 1) * 30;
    const AttackedPicture nearest = FieldRotationAttack::apply(marked.view(), 30, seed),
                          smooth = RotationAttack::apply(marked.view(), angle, 0);
    double difference = 0, light = 0;
    for (std::size_t i = 0; i < 6000; ++i) {
      difference += std::abs(static_cast<double>(nearest.planes[i] - smooth.planes[i]));
      light += static_cast<double>(smooth.planes[i]);
    }
    CAPTURE(angle);
    CHECK(difference < 0.35 * light);
  }
}

TEST_CASE("attack/field_attacks: brightness is a factor of the seed") {
  const Picture picture;
  CHECK(attacked(picture, "field_brightness:0").planes == picture.pixels);
  const AttackedPicture once = attacked(picture, "field_brightness", 5);
  CHECK(attacked(picture, "field_brightness", 5).planes == once.planes);
  CHECK(attacked(picture, "field_brightness", 6).planes != once.planes);
}

}  // namespace field_attacks_test
