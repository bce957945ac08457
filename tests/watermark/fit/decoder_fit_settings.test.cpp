// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/fit/decoder_fit_settings.hpp"

#include <doctest/doctest.h>

#include <array>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

TEST_CASE("fit/decoder_fit_settings: gentle edits stay in their ranges, and are never nothing nor a rotation") {
  const AugmentationSettings edits = gentle_edits();
  const Random random(3, 0, random_stage("test/gentle edits"));
  std::array<int, augmentation_count> drawn{};
  for (std::uint64_t i = 0; i < 4000; ++i) {
    const AugmentationDraw draw = draw_augmentation(edits, random, 8 * i);
    ++drawn[static_cast<std::size_t>(draw.kind)];
    const auto within = [&](double low, double high) { CHECK((draw.amount >= low && draw.amount <= high)); };
    switch (draw.kind) {
      case Augmentation::crop:
        within(0.5, 1);
        break;
      case Augmentation::resize:
        within(0.5, 1.1);
        break;
      case Augmentation::blur:
        within(0.3, 1);
        break;
      case Augmentation::noise:
        within(0.005, 0.03);
        break;
      case Augmentation::brightness:
        within(0.9, 1.1);
        break;
      case Augmentation::jpeg:
        within(60, 97);
        break;
      default:
        FAIL("drew nothing, or a rotation");
    }
  }
  // Of 6.5 parts: JPEG two, blur a half, the others one each. Five deviations of 4,000 draws are 0.035.
  const auto share = [&](Augmentation kind) { return drawn[static_cast<std::size_t>(kind)] / 4000.0; };
  CHECK(share(Augmentation::jpeg) == doctest::Approx(2 / 6.5).epsilon(0.12));
  CHECK(share(Augmentation::blur) == doctest::Approx(0.5 / 6.5).epsilon(0.3));
  CHECK(share(Augmentation::noise) == doctest::Approx(1 / 6.5).epsilon(0.2));
}

TEST_CASE("fit/decoder_fit_settings: without a codec a JPEG is the image itself") {
  std::vector<float> in(3 * 4 * 5), out(in.size(), -1.f);
  for (std::size_t i = 0; i < in.size(); ++i) in[i] = static_cast<float>(i);
  NoJpeg{}(ImageView<const float>{in.data(), 3, 4, 5}, 10, ImageView<float>{out.data(), 3, 4, 5});
  CHECK(in == out);
}
