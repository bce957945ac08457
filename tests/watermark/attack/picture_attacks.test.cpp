// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/attack/picture_attacks.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "support/decoder.hpp"

namespace picture_attacks_test {
namespace {

using namespace compmark;

struct Picture {
  std::vector<float> pixels = testing::random_image<float>(24, 32);
  ImageView<const float> view{pixels.data(), 3, 24, 32};
};
AttackedPicture attacked(const Picture& picture, const std::string& text, std::uint64_t seed = 0) {
  auto result = attack_picture<PictureAttacks>(text, picture.view, seed);
  REQUIRE(result.ok());
  return std::move(*result);
}
double deviation(const std::vector<float>& values) {
  double mean = 0, squares = 0;
  for (const float value : values) mean += static_cast<double>(value) / static_cast<double>(values.size());
  for (const float value : values)
    squares += std::pow(static_cast<double>(value) - mean, 2) / static_cast<double>(values.size());
  return std::sqrt(squares);
}

}  // namespace

TEST_CASE(
    "attack/picture_attacks: at the usual strength and at both ends pixels stay colours, the same for the same seed") {
  const Picture picture;
  PictureAttacks::each([&]<class A>() {
    for (const double amount : {A::amount.usual, A::amount.least, A::amount.most}) {
      CAPTURE(std::string(A::name));
      CAPTURE(amount);
      const AttackedPicture once = A::apply(picture.view, amount, 3);
      CHECK(once.view().size() == once.planes.size());
      CHECK(std::all_of(once.planes.begin(), once.planes.end(), [](float v) { return v >= 0 && v <= 1; }));
      CHECK(A::apply(picture.view, amount, 3).planes == once.planes);
    }
    CHECK(A::apply(picture.view, A::amount.usual, 3).planes != picture.pixels);
  });
}

TEST_CASE("attack/picture_attacks: each does what it is called") {
  const Picture picture;
  const AttackedPicture crop = attacked(picture, "crop:0.25"), small = attacked(picture, "resize:0.5");
  CHECK((crop.height == 12 && crop.width == 16));
  CHECK(crop.view()(1, 0, 0) == picture.view(1, 6, 8));
  CHECK((small.height == 12 && small.width == 16));
  CHECK(deviation(small.planes) < 0.7 * deviation(picture.pixels));
  CHECK(deviation(attacked(picture, "blur:2").planes) < 0.3 * deviation(picture.pixels));
  const AttackedPicture turned = attacked(picture, "rotation:180");
  CHECK(turned.view()(2, 0, 0) == doctest::Approx(picture.view(2, 23, 31)).epsilon(1e-4));
  const AttackedPicture dark = attacked(picture, "brightness:0.5");
  for (std::size_t i = 0; i < dark.planes.size(); ++i) CHECK(dark.planes[i] == 0.5f * picture.pixels[i]);
  CHECK(attacked(picture, "brightness:1").planes == picture.pixels);
  CHECK(attacked(picture, "noise:0").planes == picture.pixels);
  const AttackedPicture gamma = attacked(picture, "gamma:2"), grey = attacked(picture, "saturation:0"),
                        hue = attacked(picture, "hue:120"), same = attacked(picture, "hue:0");
  for (std::size_t i = 0; i < gamma.planes.size(); ++i)
    CHECK(gamma.planes[i] == doctest::Approx(picture.pixels[i] * picture.pixels[i]).epsilon(1e-5));
  const std::size_t plane = picture.view.plane_size();
  for (std::size_t i = 0; i < plane; ++i) {
    const float luma =
        0.299f * picture.pixels[i] + 0.587f * picture.pixels[plane + i] + 0.114f * picture.pixels[2 * plane + i];
    for (std::size_t c = 0; c < 3; ++c) CHECK(grey.planes[c * plane + i] == doctest::Approx(luma).epsilon(2e-3));
  }
  CHECK(hue.planes != picture.pixels);
  for (std::size_t i = 0; i < same.planes.size(); ++i)
    CHECK(same.planes[i] == doctest::Approx(picture.pixels[i]).epsilon(1e-4));
  double fine = 0, coarse = 0;
  const AttackedPicture good = attacked(picture, "jpeg:95"), bad = attacked(picture, "jpeg:10");
  for (std::size_t i = 0; i < good.planes.size(); ++i) {
    fine += std::pow(static_cast<double>(good.planes[i] - picture.pixels[i]), 2);
    coarse += std::pow(static_cast<double>(bad.planes[i] - picture.pixels[i]), 2);
  }
  CHECK((fine > 0 && fine < 0.3 * coarse));
  const AttackedPicture framed = attacked(picture, "frame:5");
  CHECK((framed.height == 34 && framed.width == 42));
  CHECK(framed.view()(1, 5, 5) == picture.view(1, 0, 0));
  CHECK(framed.view()(0, 4, 20) == 0.96f);
  const AttackedPicture chat = attacked(picture, "chat:0.5");
  CHECK((chat.height == 12 && chat.width == 16));
  CHECK(attacked(picture, "noise", 1).planes != attacked(picture, "noise", 2).planes);
}

}  // namespace picture_attacks_test
