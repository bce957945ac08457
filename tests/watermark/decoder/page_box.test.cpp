// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/page_box.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {
namespace page_box_test {

using Colour = std::array<float, 3>;

struct Sheet {
  int height, width;
  std::vector<float> values;

  Sheet(int h, int w, Colour colour) : height(h), width(w) {
    for (const float value : colour)
      values.insert(values.end(), static_cast<std::size_t>(h) * static_cast<std::size_t>(w), value);
  }
  [[nodiscard]] ImageView<float> view() { return {values.data(), 3, height, width}; }
  [[nodiscard]] PictureBox box() { return page_box(ImageView<const float>(view())); }

  Sheet& filled(const PictureBox& box, Colour colour) {
    for (int c = 0; c < 3; ++c) {
      for (int y = box.top; y < box.top + box.height; ++y)
        std::fill_n(view().row(c, y) + box.left, box.width, colour[static_cast<std::size_t>(c)]);
    }
    return *this;
  }
  /// Waves of colour in an ellipse, or everywhere.
  Sheet& with_object(const PictureBox& box, bool ellipse) {
    for (int y = 0; y < box.height; ++y) {
      for (int x = 0; x < box.width; ++x) {
        const double u = 2.0 * x / box.width - 1, v = 2.0 * y / box.height - 1;
        if (ellipse && u * u + v * v > 1) continue;
        for (int c = 0; c < 3; ++c)
          view()(c, box.top + y, box.left + x) =
              static_cast<float>(0.45 + 0.3 * std::sin(9 * u + 2 * c) * std::cos(7 * v + c));
      }
    }
    return *this;
  }
  /// Lines of dark strokes of one to five pixels, in words.
  Sheet& with_text(const PictureBox& box, Colour ink, int line = 16) {
    const Random random(7, static_cast<std::uint64_t>(box.top), random_stage("tests/page_box"));
    std::uint64_t drawn = 0;
    for (int top = box.top; top + line <= box.top + box.height; top += line) {
      for (int x = box.left; x < box.left + box.width - 6;) {
        const int stroke = 1 + static_cast<int>(3 * random.uniform(drawn++));
        const int tall = line / 4 + static_cast<int>(random.uniform(drawn++) * line / 3);
        filled({top + line * 2 / 3 - tall, x, tall, stroke}, ink);
        x += stroke + 2 + (random.uniform(drawn++) < 0.15 ? 6 : 0);
      }
    }
    return *this;
  }
};

constexpr Colour white{1, 1, 1}, black{0, 0, 0}, grey{0.4f, 0.4f, 0.4f}, dark{0.08f, 0.08f, 0.1f};

bool covers(const PictureBox& box, const PictureBox& part) {
  return box.top <= part.top && box.left <= part.left && box.top + box.height >= part.top + part.height &&
         box.left + box.width >= part.left + part.width;
}

/// Text above and below, a bar on top, and a picture of its own background in between.
Sheet article(Colour page, Colour ink, Colour background, const PictureBox& picture) {
  Sheet sheet(760, 1000, page);
  sheet.filled({0, 0, 14, 1000}, {0.15f, 0.25f, 0.5f});
  sheet.with_text({30, 40, 120, 900}, ink).with_text({600, 40, 120, 900}, ink);
  sheet.filled(picture, background);
  return sheet.with_object({picture.top + 30, picture.left + 40, picture.height - 60, picture.width - 80}, true);
}

}  // namespace page_box_test
}  // namespace

TEST_CASE("decoder/page_box: the picture of a page is found, with none of its text, where flat lines alone fail") {
  namespace test = page_box_test;
  const PictureBox picture{180, 300, 400, 400};
  const PictureBox between{136, 0, 465, 1000};  // the lowest ink above, the highest below
  for (const test::Colour& background : {test::white, test::black, test::grey}) {
    CAPTURE(background[0]);
    test::Sheet sheet = test::article(test::white, test::dark, background, picture);
    const PictureBox box = sheet.box();
    CHECK(test::covers(box, {picture.top + 30, picture.left + 40, picture.height - 60, picture.width - 80}));
    CHECK(test::covers(between, box));
    // The control: without the cut everything but the margins is the subject.
    const PictureBox flat = subject_box(ImageView<const float>(sheet.view()));
    CHECK(flat.height > 500);
    CHECK(flat.width > 800);
  }
  // A dark page, and a photograph without a background.
  test::Sheet dark(760, 1000, test::dark);
  dark.with_text({30, 40, 120, 900}, test::white).with_text({600, 40, 120, 900}, test::white);
  dark.with_object(picture, false);
  CHECK(test::covers(dark.box(), picture));
  CHECK(test::covers(between, dark.box()));
}

TEST_CASE("decoder/page_box: text beside the picture goes too, at any size of the page") {
  namespace test = page_box_test;
  for (const int scale : {1, 2, 3}) {
    CAPTURE(scale);
    const PictureBox picture{60 * scale, 40 * scale, 360 * scale, 420 * scale};
    test::Sheet sheet(480 * scale, 900 * scale, test::white);
    sheet.with_object(picture, true);
    sheet.with_text({60 * scale, 560 * scale, 340 * scale, 300 * scale}, test::dark, 16 * scale);
    sheet.filled({440 * scale, 560 * scale, 20 * scale, 90 * scale}, {0.2f, 0.4f, 0.9f});  // a button
    const PictureBox box = sheet.box();
    CHECK(test::covers(box, picture));
    CHECK(box.left + box.width <= 560 * scale);
  }
}

TEST_CASE("decoder/page_box: photographs, renders and objects of several parts are kept whole") {
  namespace test = page_box_test;
  const auto is_whole = [](test::Sheet& sheet) { return sheet.box() == PictureBox{0, 0, sheet.height, sheet.width}; };
  test::Sheet photograph(400, 600, test::black);
  photograph.with_object({0, 0, 400, 600}, false);
  CHECK(is_whole(photograph));
  for (const test::Colour& colour : {test::white, test::black, test::grey}) {
    test::Sheet render(400, 400, colour);
    render.with_object({80, 60, 240, 280}, true);
    CHECK(is_whole(render));
    // A table and two chairs, and a crumb: separated by gaps, and none of them text.
    test::Sheet several(400, 600, colour);
    several.with_object({100, 20, 150, 120}, true).with_object({80, 180, 240, 220}, true);
    several.with_object({100, 440, 150, 120}, true).with_object({360, 290, 8, 8}, true);
    CHECK(is_whole(several));
    // Crumbs round it: floaters of a render.
    for (int crumbs = 1; crumbs <= 6; ++crumbs) {
      CAPTURE(crumbs);
      test::Sheet floating(400, 400, colour);
      floating.with_object({80, 60, 240, 280}, true);
      for (int i = 0; i < crumbs; ++i) {
        const PictureBox crumb{(i % 2 == 0 ? 10 : 340) + 6 * i, 40 + 50 * i, 5, 5};
        if (i % 3 == 0) {
          floating.filled(crumb, {0.7f, 0.2f, 0.3f});
        } else {
          floating.with_object(crumb, true);
        }
      }
      CHECK(is_whole(floating));
    }
    test::Sheet flat(300, 300, colour);
    CHECK(is_whole(flat));
  }
  // Text alone is no picture.
  test::Sheet letter(700, 600, test::white);
  letter.with_text({40, 40, 200, 520}, test::dark).with_text({300, 40, 300, 520}, test::dark);
  CHECK(is_whole(letter));
  test::Sheet tiny(3, 2, test::grey);
  CHECK(is_whole(tiny));
  // What is no number is for the reading to show.
  test::Sheet broken = test::article(test::white, test::dark, test::white, {180, 300, 400, 400});
  std::fill(broken.values.begin(), broken.values.end(), std::numeric_limits<float>::quiet_NaN());
  CHECK(is_whole(broken));
}
