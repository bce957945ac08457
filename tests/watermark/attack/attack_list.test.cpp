// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks of one's own, on a picture and on a model: each is one type, and no file of the library is edited; to ship
// one is one edit, its type and its name in picture_attacks.hpp or model_attacks.hpp.
#include "compmark/watermark/attack/attack_list.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/watermark/attack/model_attacks.hpp"
#include "compmark/watermark/attack/picture_attacks.hpp"
#include "support/decoder.hpp"

namespace attack_list_test {
namespace {

using namespace compmark;

/// A screenshot of few colours.
struct PosterAttack {
  static constexpr std::string_view name = "poster";
  static constexpr AttackAmount amount{8, 2, 64, "the levels of a colour"};
  static AttackedPicture apply(ImageView<const float> image, double levels, std::uint64_t) {
    AttackedPicture out{image.height, image.width, {image.data, image.data + image.size()}};
    for (float& value : out.planes)
      value = static_cast<float>(std::round(static_cast<double>(value) * (levels - 1)) / (levels - 1));
    return out;
  }
};
/// What is small becomes nothing.
struct ZeroAttack {
  static constexpr std::string_view name = "zero";
  static constexpr AttackAmount amount{0.1, 0, 1, "the size below which a number becomes 0"};
  static Result<Done> apply(ParameterArena<float>& arena, double least, std::uint64_t) {
    for (float& value : arena.all_values()) value = std::abs(value) < static_cast<float>(least) ? 0.0f : value;
    return Done{};
  }
};
static_assert(PictureAttack<PosterAttack> && !ModelAttack<PosterAttack>);
static_assert(ModelAttack<ZeroAttack> && !PictureAttack<ZeroAttack>);
using Pictures = PictureAttacks::With<PosterAttack>;
using Models = ModelAttacks::With<ZeroAttack>;

}  // namespace

TEST_CASE("attack/attack_list: an attack of one's own is found by its name, at its usual strength or another") {
  const std::vector<float> pixels = testing::random_image<float>(9, 7);
  const ImageView<const float> image{pixels.data(), 3, 9, 7};
  const auto levels = [&](const char* text) {
    const auto attacked = attack_picture<Pictures>(text, image);
    REQUIRE(attacked.ok());
    CHECK(attacked->view().size() == image.size());
    std::vector<float> values = attacked->planes;
    std::sort(values.begin(), values.end());
    return std::unique(values.begin(), values.end()) - values.begin();
  };
  CHECK(levels("poster") == 8);
  CHECK(levels("poster:3") == 3);
  CHECK(levels("brightness:1") > 100);  // the shipped ones are there too

  ParameterArena<float> arena;
  const BlockHandle block =
      arena.add("anchor.feature", 2, 2, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  std::copy_n(std::vector<float>{0.05f, -0.2f, 0.5f, -0.01f}.data(), 4, arena.values(block).data);
  REQUIRE(attack_model<Models>("zero", arena).ok());
  CHECK(std::vector<float>(arena.values(block).data, arena.values(block).data + 4) ==
        std::vector<float>{0, -0.2f, 0.5f, 0});
}

TEST_CASE(
    "attack/attack_list: a name that is not there, or a strength out of range, is one line that says what there is") {
  const std::vector<float> pixels(3 * 8 * 8, 0.5f);
  const ImageView<const float> image{pixels.data(), 3, 8, 8};
  CHECK(attack_picture<PictureAttacks>("poster", image).error().line() ==
        "attack: \"poster\" is none of crop, resize, rotation, blur, noise, brightness, gamma, contrast, hue, "
        "saturation, jpeg, frame, page, paint, mirror, median, sharpen, levels, chat, screenshot, field_noise, "
        "field_crop, field_scale, "
        "field_rotation, field_blur, field_brightness, palette, resample; choose one of them");
  for (const char* text : {"blur:", "blur:x", "blur:1.5x", "blur:0", "blur:21", "blur:nan", "", ":", "blur:1:2"}) {
    CAPTURE(text);
    CHECK_FALSE(attack_picture<PictureAttacks>(text, image).ok());
    CHECK_FALSE(check_attack<PictureAttacks>(text).ok());
  }
  CHECK(attack_picture<PictureAttacks>("blur:21", image).error().line() ==
        "attack: \"blur:21\" has no strength from 0.1 to 20; give the deviation of the blur in pixels");
  CHECK(check_attack<PictureAttacks>("blur:20").ok());
  // What is done in whole steps has no strength between them: nothing is rounded behind the report's back.
  for (const char* text : {"median:4", "median:3.5", "mirror:1.7", "levels:2.5", "frame:2.5", "jpeg:50.5"})
    CHECK_FALSE(check_attack<PictureAttacks>(text).ok());
  for (const char* text : {"median:5", "median:1", "mirror:2", "levels:8", "frame:512", "jpeg:100"})
    CHECK(check_attack<PictureAttacks>(text).ok());
  CHECK(check_attack<PictureAttacks>("median:4").error().problem ==
        "\"median:4\" has no strength from 1 to 15 in steps of 2");
  CHECK(check_attack<PictureAttacks>("chat").ok());
  ParameterArena<float> arena;
  for (const char* text : {"clone:-0.1", "clone:1.1", "clone:nan", "clone:", "clone:half"}) {
    CAPTURE(text);
    CHECK(attack_model<ModelAttacks>(text, arena)
              .error()
              .line()
              .find("has no strength from 0 to 1; give the share of the anchors that is doubled") != std::string::npos);
  }
  CHECK(attack_model<ModelAttacks>("crop", arena).error().line().find("none of int8, noise, prune, clone") !=
        std::string::npos);
}

}  // namespace attack_list_test
