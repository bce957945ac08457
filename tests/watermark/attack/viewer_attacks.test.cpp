// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// That each keeps colours and repeats itself is tested for the whole list (picture_attacks.test.cpp).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/watermark/attack/picture_attacks.hpp>
#include <cstddef>
#include <set>
#include <vector>

#include "support/decoder.hpp"

namespace viewer_attacks_test {
namespace {

using namespace compmark;

struct Picture {
  std::vector<float> pixels = testing::random_image<float>(24, 32);
  ImageView<const float> view{pixels.data(), 3, 24, 32};
};
template <class Attack>
AttackedPicture attacked(const Picture& picture, double amount, std::uint64_t seed = 0) {
  return Attack::apply(picture.view, amount, seed);
}

}  // namespace

TEST_CASE("attack/viewer_attacks: each does what it is called") {
  const Picture picture;
  const AttackedPicture beside = attacked<MirrorAttack>(picture, 1), below = attacked<MirrorAttack>(picture, 2);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      CHECK(beside.view()(1, y, x) == picture.view(1, y, 31 - x));
      CHECK(below.view()(2, y, x) == picture.view(2, 23 - y, x));
    }
  }
  CHECK(MirrorAttack::apply(beside.view(), 1, 0).planes == picture.pixels);

  CHECK(attacked<ContrastAttack>(picture, 1).planes[5] == doctest::Approx(picture.pixels[5]));
  const AttackedPicture flat = attacked<ContrastAttack>(picture, 0);
  CHECK(*std::max_element(flat.planes.begin(), flat.planes.end()) ==
        *std::min_element(flat.planes.begin(), flat.planes.end()));

  CHECK(attacked<MedianAttack>(picture, 1).planes == picture.pixels);
  std::vector<float> nine;
  for (int y = 4; y <= 6; ++y)
    for (int x = 9; x <= 11; ++x) nine.push_back(picture.view(0, y, x));
  std::sort(nine.begin(), nine.end());
  CHECK(attacked<MedianAttack>(picture, 3).view()(0, 5, 10) == nine[4]);

  CHECK(attacked<SharpenAttack>(picture, 0).planes == picture.pixels);
  float sum = 0;
  for (const float value : nine) sum += value;
  const float value = picture.view(0, 5, 10);
  CHECK(attacked<SharpenAttack>(picture, 1).view()(0, 5, 10) ==
        doctest::Approx(std::clamp(2 * value - sum / 9, 0.0f, 1.0f)));

  const AttackedPicture two = attacked<LevelsAttack>(picture, 2);
  CHECK(std::set<float>(two.planes.begin(), two.planes.end()).size() == 4);
  for (std::size_t i = 0; i < two.planes.size(); ++i)
    CHECK(std::abs(two.planes[i] - picture.pixels[i]) <= 1.0f / 6 + 1e-6f);
}

TEST_CASE("attack/viewer_attacks: paint covers its share in one colour, somewhere; a page lies round the picture") {
  const Picture picture;
  std::set<std::size_t> places;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const AttackedPicture painted = attacked<PaintAttack>(picture, 0.25, seed);
    std::size_t changed = 0, first = 0;
    for (std::size_t i = 0; i < 24 * 32; ++i) {
      if (painted.planes[i] == picture.pixels[i]) continue;
      if (changed++ == 0) first = i;
      CHECK(painted.planes[i] == painted.planes[first]);
    }
    CHECK(changed == 12 * 16);
    places.insert(first);
  }
  CHECK(places.size() > 1);
  CHECK(attacked<PaintAttack>(picture, 0).planes == picture.pixels);

  const AttackedPicture page = attacked<PageAttack>(picture, 0.4);
  CHECK(page.height == 24 + 6 + 2);
  CHECK(page.width == 32 + 5 + 5);
  CHECK(page.view()(0, 0, 0) == 0.4f);
  CHECK(page.view()(2, 31, 41) == 0.4f);
  CHECK(page.view()(1, 6 + 3, 5 + 7) == picture.view(1, 3, 7));
  const AttackedPicture screen = attacked<ScreenshotAttack>(picture, 0.5);
  CHECK((screen.height == 12 + 32 && screen.width == 16 + 32));
}

}  // namespace viewer_attacks_test
