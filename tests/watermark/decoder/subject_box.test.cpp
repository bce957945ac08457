// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/subject_box.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "compmark/watermark/decoder/reference_decoder.hpp"
#include "compmark/watermark/edit/augmentation_edit.hpp"
#include "support/decoder.hpp"

namespace {

using namespace compmark;

struct Picture {
  int height, width;
  std::vector<double> values;

  Picture(int h, int w, std::array<double, 3> colour) : height(h), width(w) {
    for (const double value : colour)
      values.insert(values.end(), static_cast<std::size_t>(h) * static_cast<std::size_t>(w), value);
  }
  [[nodiscard]] ImageView<double> view() { return {values.data(), 3, height, width}; }
  [[nodiscard]] PictureBox box() { return subject_box(ImageView<const double>(view())); }
  /// Coarse texture in a part of it.
  Picture& with_object(const PictureBox& box) {
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < box.height; ++y) {
        for (int x = 0; x < box.width; ++x) {
          const double wave = std::sin(23.0 * x / box.width + 2 * c + 1) * std::cos(19.0 * y / box.height + c);
          view()(c, box.top + y, box.left + x) = 0.4 + 0.25 * wave;
        }
      }
    }
    return *this;
  }
  [[nodiscard]] Picture framed(int border, std::array<double, 3> colour) {
    Picture outer(height + 2 * border, width + 2 * border, colour);
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < height; ++y) std::copy_n(view().row(c, y), width, outer.view().row(c, y + border) + border);
    }
    return outer;
  }
  template <class Map>
  [[nodiscard]] Picture mapped(const Map& map) const {
    Picture result = *this;
    for (double& value : result.values) value = std::clamp(map(value), 0.0, 1.0);
    return result;
  }
};

/// The largest distance of two boxes' sides, in pixels.
int distance(const PictureBox& a, const PictureBox& b) {
  return std::max({std::abs(a.top - b.top), std::abs(a.left - b.left), std::abs(a.top + a.height - b.top - b.height),
                   std::abs(a.left + a.width - b.left - b.width)});
}
int block_of(const Picture& picture) { return (std::max(picture.height, picture.width) + 39) / 40; }

/// What the box would be if every pixel of the corner's colour were background.
PictureBox naive_box(Picture& picture) {
  int top = picture.height, left = picture.width, bottom = 0, right = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      bool other = false;
      for (int c = 0; c < 3; ++c)
        other = other || std::abs(picture.view()(c, y, x) - picture.view()(c, 0, 0)) > 1.0 / 64;
      if (!other) continue;
      top = std::min(top, y), left = std::min(left, x), bottom = std::max(bottom, y + 1),
      right = std::max(right, x + 1);
    }
  }
  return {top, left, bottom - top, right - left};
}

/// What is wrong with the gradient that a decoder of five bits adds for a weighted sum of its logits; empty: nothing.
template <class Decoder>
std::string gradient_fault(const Decoder& decoder, Picture& picture, std::vector<double>* kept = nullptr) {
  ThreadExecutor executor(2);
  typename Decoder::Context context;
  const std::vector<double> slope{1, -0.5, 0.3, 2, -1};
  const auto loss = [&] {
    std::vector<double> z(5);
    decoder.forward(ImageView<const double>(picture.view()), std::span<double>(z), context, executor);
    double sum = 0;
    for (std::size_t i = 0; i < z.size(); ++i) sum += slope[i] * z[i];
    return sum;
  };
  static_cast<void>(loss());
  std::vector<double> gradient(picture.values.size(), 3.0);
  decoder.backward(std::span<const double>(slope), {gradient.data(), 3, picture.height, picture.width}, context,
                   executor);
  for (double& value : gradient) value -= 3;  // it adds
  if (kept != nullptr) *kept = gradient;
  return testing::gradient_law(loss, picture.values, gradient);
}

}  // namespace

TEST_CASE("decoder/subject_box: an object is found to a block, at any size of the picture and on any colour") {
  for (const auto& [height, width] : {std::pair{40, 40}, {97, 80}, {256, 256}, {300, 400}, {1001, 700}}) {
    for (const double grey : {0.0, 0.4, 1.0}) {
      Picture picture(height, width, {grey, 1 - grey, 0.5});
      const PictureBox object{height / 5, width / 4, height / 2, width / 2};
      CHECK(distance(picture.with_object(object).box(), object) <= block_of(picture));
    }
  }
}

TEST_CASE("decoder/subject_box: edits leave the box where it was, and a box of equal pixels moves") {
  const PictureBox object{90, 120, 180, 170};
  for (const double grey : {0.2, 0.4, 1.0}) {
    Picture plain(400, 400, {grey, grey, grey});
    plain.with_object(object);
    const PictureBox box = plain.box();
    const Random random(5, 0, random_stage("subject box noise"));
    std::uint64_t i = 0;
    Picture noisy = plain.mapped([&](double v) { return v + 0.1 * random.normal(i++); });
    CHECK(distance(noisy.box(), box) <= block_of(plain));
    CHECK(naive_box(noisy) == PictureBox{0, 0, 400, 400});  // the control
    CHECK(plain.mapped([](double v) { return 1.3 * v; }).box() == box);
    CHECK(plain.mapped([](double v) { return 0.7 * v; }).box() == box);
    CHECK(plain.mapped([](double v) { return std::pow(v, 1.4); }).box() == box);
    Picture jpeg = plain;
    jpeg_picture<double>(ImageView<const double>(plain.view()), 30, jpeg.view());
    CHECK(distance(jpeg.box(), box) <= block_of(plain));
    // … and a frame of another colour round the background is taken too; two of them as well.
    for (const std::array<double, 3>& colour : {std::array{0.96, 0.96, 0.96}, {0.1, 0.3, 0.9}, {0.0, 0.0, 0.0}}) {
      Picture framed = plain.framed(20, colour), page = framed.framed(37, {1 - colour[0], 0.5, 0.5});
      const PictureBox in_frame{object.top + 20, object.left + 20, object.height, object.width};
      const PictureBox in_page{object.top + 57, object.left + 57, object.height, object.width};
      CHECK(distance(framed.box(), in_frame) <= block_of(framed));
      CHECK(distance(page.box(), in_page) <= block_of(page));
      CHECK(naive_box(page).height > 400);  // the control: no more than the page
    }
  }
}

TEST_CASE("decoder/subject_box: what has no flat surroundings is kept whole") {
  const auto whole = [](Picture picture) { return picture.box() == PictureBox{0, 0, picture.height, picture.width}; };
  CHECK(whole(Picture(64, 90, {0.5, 0.5, 0.5})));                              // nothing but flat
  CHECK(whole(Picture(64, 90, {0.5, 0.5, 0.5}).with_object({0, 0, 64, 90})));  // nothing flat
  CHECK(whole(Picture(640, 640, {1, 1, 1}).with_object({300, 300, 20, 20})));  // a speck
  CHECK(whole(Picture(1, 1, {1, 1, 1})));
  Picture damaged(64, 64, {1, 1, 1});
  std::fill(damaged.values.begin(), damaged.values.end(), std::numeric_limits<double>::quiet_NaN());
  CHECK(whole(damaged));
  for (const std::size_t at : {std::size_t(0), std::size_t(3 * 64 * 64 - 1), std::size_t(64 * 20)}) {  // a corner too
    Picture one = Picture(64, 64, {1, 1, 1}).with_object({20, 20, 24, 24});
    CHECK(!whole(one));
    one.values[at] = std::numeric_limits<double>::quiet_NaN();
    CHECK(whole(one));
  }
  Picture ramp(200, 200, {0, 0, 0});  // as a sky
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 200; ++y) {
      for (int x = 0; x < 200; ++x) ramp.view()(c, y, x) = x / 200.0;
    }
  }
  CHECK(ramp.box().height == 200);
  // Less than a sixteenth of a side is too little, a given number of pixels may be.
  Picture small = Picture(200, 200, {1, 1, 1}).with_object({80, 80, 40, 30});
  CHECK(small.box() != PictureBox{0, 0, 200, 200});
  CHECK(subject_box(ImageView<const double>(small.view()), 48) == PictureBox{0, 0, 200, 200});
}

TEST_CASE(
    "decoder/subject_box: a side that the object touches stays, and a thin one is widened within its background") {
  Picture touching = Picture(400, 400, {1, 1, 1}).with_object({150, 0, 250, 240});
  CHECK(touching.box() == PictureBox{150, 0, 250, 240});
  Picture thin = Picture(400, 400, {1, 1, 1}).with_object({180, 50, 40, 300});
  const PictureBox box = thin.box();
  CHECK(box.width == 300);
  CHECK(box.height == 225);  // 4:3
  CHECK(std::abs(2 * box.top + box.height - 400) <= 1);
  Picture letter = Picture(60, 400, {1, 1, 1}).with_object({10, 50, 40, 300}).framed(100, {0, 0, 0});
  const PictureBox inside = letter.box();  // widened to the white, not into the black
  CHECK(inside.height <= 60 + 2 * block_of(letter));
  CHECK(inside.height >= 50);
}

TEST_CASE("decoder/subject_box: a decoder of subjects reads in a frame what it reads without one") {
  DecoderWeights weights = testing::small_decoder(5, 9, 2);
  weights.input = imagenet_convention(0);
  weights.input.largest_side = weights.input.smallest_side = 24;
  weights.input.subject_alone = true;
  const auto decoder = HiddenDecoder<0, 0, 0, double>::create(weights);
  REQUIRE(decoder.ok());
  CHECK(testing::message_decoder_laws(*decoder, 40, 44) == "");
  Picture alone = Picture(40, 40, {1, 1, 1}).with_object({0, 0, 40, 40});
  Picture framed = alone.framed(10, {1, 0.5, 0.2});
  ThreadExecutor executor(2);
  HiddenDecoder<0, 0, 0, double>::Context context;
  const auto logits = [&](const auto& reader, Picture& picture) {
    std::vector<double> result(5);
    reader.forward(ImageView<const double>(picture.view()), std::span<double>(result), context, executor);
    return result;
  };
  const std::vector<double> expected = logits(*decoder, alone), found = logits(*decoder, framed);
  const auto exact = reference_logits<double>(weights, ImageView<const double>(framed.view()));
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(found[i] == expected[i]);
    CHECK(std::abs(found[i] - exact[i]) < 1e-12);
  }
  weights.input.subject_alone = false;
  const auto whole = HiddenDecoder<0, 0, 0, double>::create(weights);
  CHECK(std::abs(logits(*whole, framed)[0] - expected[0]) > 1e-4);  // the control

  std::vector<double> gradient;
  CHECK(gradient_fault(*decoder, framed, &gradient) == "");
  CHECK(gradient[0] == 0);
}

TEST_CASE(
    "decoder/subject_box: a decoder that reads the middle too takes the mean of both readings, and its gradient") {
  CHECK(middle_of({10, 20, 100, 50}, 0.8) == PictureBox{20, 25, 80, 40});
  CHECK(middle_of({0, 0, 1, 7}, 0.1) == PictureBox{0, 3, 1, 1});
  DecoderWeights weights = testing::small_decoder(5, 9, 2);
  weights.input = imagenet_convention(0);
  weights.input.largest_side = weights.input.smallest_side = 24;
  weights.input.subject_alone = true;
  const auto once = HiddenDecoder<0, 0, 0, double>::create(weights);
  weights.input.middle = 0.75;
  const auto twice = HiddenDecoder<0, 0, 0, double>::create(weights);
  REQUIRE(once.ok());
  REQUIRE(twice.ok());
  CHECK(testing::message_decoder_laws(*twice, 40, 44) == "");
  ThreadExecutor executor(2);
  HiddenDecoder<0, 0, 0, double>::Context context;
  const auto logits = [&](const auto& reader, Picture& picture) {
    std::vector<double> result(5);
    reader.forward(ImageView<const double>(picture.view()), std::span<double>(result), context, executor);
    return result;
  };
  Picture framed = Picture(40, 40, {1, 1, 1}).with_object({0, 0, 40, 40}).framed(10, {1, 0.5, 0.2});
  Picture middle(30, 30, {0, 0, 0});
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 30; ++x) middle.view()(c, y, x) = framed.view()(c, y + 15, x + 15);
    }
  }
  const std::vector<double> whole = logits(*once, framed), part = logits(*once, middle);
  std::vector<double> both = logits(*twice, framed);
  const auto exact = reference_logits<double>(weights, ImageView<const double>(framed.view()));
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(std::abs(both[i] - (whole[i] + part[i]) / 2) < 1e-12);
    CHECK(std::abs(both[i] - exact[i]) < 1e-12);
    CHECK(std::abs(both[i] - whole[i]) > 1e-6);  // the control: the middle says something else
  }
  CHECK(gradient_fault(*twice, framed) == "");
  // A middle that would be too small is left alone, and what follows it is read as ever.
  Picture least(twice->minimum_size(), twice->minimum_size(), {0.2, 0.6, 0.4});
  least.with_object({0, 0, least.height, least.width});
  CHECK(logits(*twice, least) == logits(*once, least));
  CHECK(logits(*twice, framed) == both);
}
