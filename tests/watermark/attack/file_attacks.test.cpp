// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/attack/file_attacks.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <set>
#include <vector>

#include "compmark/watermark/attack/picture_attacks.hpp"
#include "support/decoder.hpp"

namespace file_attacks_test {
namespace {

using namespace compmark;

struct Picture {
  std::vector<float> pixels = testing::random_image<float>(30, 41);
  ImageView<const float> view{pixels.data(), 3, 30, 41};
};
std::size_t colours_of(const AttackedPicture& picture) {
  std::set<std::array<float, 3>> colours;
  const std::size_t plane = picture.planes.size() / 3;
  for (std::size_t i = 0; i < plane; ++i)
    colours.insert({picture.planes[i], picture.planes[plane + i], picture.planes[2 * plane + i]});
  return colours.size();
}
double squares(const AttackedPicture& picture, const std::vector<float>& before) {
  double sum = 0;
  for (std::size_t i = 0; i < before.size(); ++i)
    sum += std::pow(static_cast<double>(picture.planes[i]) - static_cast<double>(before[i]), 2);
  return sum;
}

}  // namespace

TEST_CASE("attack/file_attacks: a palette has as many colours as asked for, and more of them cost less") {
  const Picture picture;
  const AttackedPicture two = PaletteAttack::apply(picture.view, 2, 0), few = PaletteAttack::apply(picture.view, 16, 0),
                        many = PaletteAttack::apply(picture.view, 256, 0);
  CHECK(colours_of(two) == 2);
  CHECK(colours_of(few) == 16);
  CHECK(colours_of(many) == 256);
  CHECK(squares(few, picture.pixels) < 0.7 * squares(two, picture.pixels));
  CHECK(squares(many, picture.pixels) < 0.7 * squares(few, picture.pixels));
  // A picture of fewer colours keeps them; their means are themselves to a rounding.
  const AttackedPicture again = PaletteAttack::apply(few.view(), 256, 0);
  CHECK(colours_of(again) <= 32);
  CHECK(squares(again, few.planes) < 1e-9);
  const std::vector<float> flat(3 * 8 * 8, 0.25f);
  CHECK(PaletteAttack::apply({flat.data(), 3, 8, 8}, 256, 0).planes == flat);
  CHECK_FALSE(check_attack<PictureAttacks>("palette:2.5").ok());
}

TEST_CASE("attack/file_attacks: resampling keeps the size, and loses more the smaller it was") {
  const Picture picture;
  const AttackedPicture half = ResampleAttack::apply(picture.view, 0.5, 0),
                        tenth = ResampleAttack::apply(picture.view, 0.1, 0);
  CHECK((half.height == 30 && half.width == 41));
  CHECK(squares(ResampleAttack::apply(picture.view, 1, 0), picture.pixels) < 1e-6);
  CHECK(squares(half, picture.pixels) > 1);
  CHECK(squares(tenth, picture.pixels) > squares(half, picture.pixels));
  const std::vector<float> flat(3 * 30 * 41, 0.25f);
  for (const float value : ResampleAttack::apply({flat.data(), 3, 30, 41}, 0.3, 0).planes)
    CHECK(value == doctest::Approx(0.25));
}

}  // namespace file_attacks_test
