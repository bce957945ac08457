// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/mask_reading.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/check_weights.hpp>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "support/png_text.hpp"
#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

constexpr int mask_width = 16, mask_height = 12;

std::string png(int bits, int type, const std::function<std::vector<int>(int x, int y)>& pixel,
                const std::string& palette = "") {
  return png_text(mask_width, mask_height, bits, type, pixel, palette);
}

/// A capture of four views, all of which have the mask of `mask(i)`; "" is none.
Result<Dataset> masked(const std::filesystem::path& folder, const std::function<std::string(int)>& mask) {
  std::error_code ignored;
  std::filesystem::remove_all(folder / "masks", ignored);
  std::string frames;
  for (int i = 0; i < 4; ++i) {
    const std::string name = std::to_string(i) + ".png";
    put_image(folder / "images" / name, mask_width, mask_height, 3 + i % 2);
    if (const std::string file = mask(i); !file.empty()) put(folder / "masks" / name, file);
    frames += (i > 0 ? "," : "") + frame_text("images/" + name);
  }
  put(folder / "transforms.json", transforms_text(frames));
  return open_dataset(folder, {});
}

bool left(int x, int) { return x < 8; }

std::size_t words(const Dataset& dataset, const std::string& text) {
  return static_cast<std::size_t>(std::count_if(dataset.warnings.begin(), dataset.warnings.end(),
                                                [&](const auto& w) { return w.find(text) != std::string::npos; }));
}

}  // namespace

TEST_CASE("scene/mask_reading: one mask, however it is written, counts the same pixels") {
  const TemporaryFolder folder;
  const std::string ramp = [] {
    std::string text;
    for (int i = 0; i < 256; ++i) text += std::string(3, static_cast<char>(i));
    return text;
  }();
  const std::string green("\0\0\0\0\x80\0\xC0\0\x20", 9);
  struct Writing {
    const char* what;
    int bits, type;
    std::function<std::vector<int>(bool, int)> pixel;  ///< of what counts, and a number that may vary
    std::string palette;
    const char* says;  ///< a word of the warning; empty: none
  };
  const std::vector<Writing> writings{
      {"0 and 255", 8, 0, [](bool in, int) { return std::vector<int>{in ? 255 : 0}; }, "", ""},
      {"0 and 1", 8, 0, [](bool in, int) { return std::vector<int>{in ? 1 : 0}; }, "", "not black"},
      {"0 and 128", 8, 0, [](bool in, int) { return std::vector<int>{in ? 128 : 0}; }, "", "not black"},
      {"labels", 8, 0, [](bool in, int v) { return std::vector<int>{in ? 1 + v % 20 : 0}; }, "", "not black"},
      {"16 bits, 65535", 16, 0, [](bool in, int) { return std::vector<int>{in ? 65535 : 0}; }, "", ""},
      {"16 bits, 1", 16, 0, [](bool in, int) { return std::vector<int>{in ? 1 : 0}; }, "", "not black"},
      {"16 bits, 255", 16, 0, [](bool in, int) { return std::vector<int>{in ? 255 : 0}; }, "", "not black"},
      {"RGB", 8, 2, [](bool in, int) { return std::vector<int>(3, in ? 255 : 0); }, "", ""},
      {"red", 8, 2,
       [](bool in, int) {
         return std::vector<int>{in ? 200 : 0, 0, 0};
       },
       "", "colours"},
      {"blue, 16 bits", 16, 2,
       [](bool in, int) {
         return std::vector<int>{0, 0, in ? 900 : 0};
       },
       "", "not black"},
      {"palette of greys", 8, 3, [](bool in, int) { return std::vector<int>{in ? 1 : 0}; }, ramp, "not black"},
      {"palette of colours", 8, 3, [](bool in, int v) { return std::vector<int>{in ? 1 + v % 2 : 0}; }, green,
       "colours"},
      {"white with alpha", 8, 6,
       [](bool in, int) {
         return std::vector<int>{255, 255, 255, in ? 255 : 0};
       },
       "", "alpha"},
      {"black with alpha", 8, 6,
       [](bool in, int) {
         return std::vector<int>{0, 0, 0, in ? 255 : 0};
       },
       "", "alpha"},
      {"grey with alpha of 1", 8, 4,
       [](bool in, int) {
         return std::vector<int>{9, in ? 1 : 0};
       },
       "", "alpha"},
      {"alpha and colour alike", 8, 4,
       [](bool in, int) {
         return std::vector<int>{in ? 255 : 0, in ? 255 : 0};
       },
       "", "alpha"},
      {"alpha everywhere", 8, 4,
       [](bool in, int) {
         return std::vector<int>{in ? 255 : 0, 255};
       },
       "", ""},
  };
  for (const Writing& w : writings) {
    CAPTURE(w.what);
    // The last view counts whole: alone it does not say which numbers are large, nor which channel is meant.
    const Result<Dataset> dataset = masked(folder.path(), [&](int i) {
      return png(
          w.bits, w.type, [&](int x, int y) { return w.pixel(i == 3 || left(x, y), x + y + i); }, w.palette);
    });
    REQUIRE(dataset.ok());
    REQUIRE(dataset->views.size() == 4);
    CHECK(words(*dataset, "mask") == (*w.says == '\0' ? 0 : 1));
    CHECK(words(*dataset, w.says) >= 1);
    ImageStore store(*dataset, {});
    for (std::size_t i = 0; i < 4; ++i) {
      const Result<const StoredImage*> image = store.get(i);
      REQUIRE(image.ok());
      const std::vector<std::uint8_t>& mask = (*image)->mask;
      if (i == 3) {
        CHECK(mask.empty());
        continue;
      }
      REQUIRE(mask.size() == mask_width * mask_height);
      for (int y = 0; y < mask_height; ++y) {
        for (int x = 0; x < mask_width; ++x)
          REQUIRE(mask[static_cast<std::size_t>(y * mask_width + x)] == (left(x, y) ? 255 : 0));
      }
    }
  }
}

TEST_CASE("scene/mask_reading: soft masks keep their weights") {
  const TemporaryFolder folder;
  for (const int bits : {8, 16}) {
    const Result<Dataset> dataset = masked(folder.path(), [&](int) {
      return png(bits, 0, [&](int x, int) { return std::vector<int>{bits == 8 ? 17 * x : 4369 * x}; });
    });
    REQUIRE(dataset.ok());
    CHECK(words(*dataset, "mask") == 0);
    ImageStore store(*dataset, {});
    const Result<const StoredImage*> image = store.get(0);
    REQUIRE(image.ok());
    for (int x = 0; x < mask_width; ++x) CHECK((*image)->mask[static_cast<std::size_t>(x)] == 17 * x);
  }
}

TEST_CASE(
    "scene/mask_reading: what counts for nothing is left out, a capture of nothing is refused, what is no mask too") {
  const TemporaryFolder folder;
  const auto grey = [](int value) {
    return png(8, 0, [value](int x, int y) { return std::vector<int>{left(x, y) ? value : 0}; });
  };
  const auto error = [&](const std::function<std::string(int)>& mask) {
    const Result<Dataset> dataset = masked(folder.path(), mask);
    REQUIRE(!dataset.ok());
    CHECK(dataset.error().file.find("masks") != std::string::npos);
    CHECK(dataset.error().field == "mask");
    return dataset.error().problem;
  };
  CHECK(error([&](int) { return grey(0); }).find("all 4 masks") != std::string::npos);
  CHECK(error([&](int i) { return i == 0 ? grey(255) : grey(0); }).find("training images") !=
        std::string::npos);  // view 0 tests
  const Result<Dataset> some = masked(folder.path(), [&](int i) { return i == 2 ? grey(0) : grey(255); });
  REQUIRE(some.ok());
  CHECK(some->views.size() == 3);
  CHECK(words(*some, "1 images are left out, as their masks are black everywhere, the first is \"images/2.png\"") == 1);
  const Result<Dataset> tests = masked(folder.path(), [&](int i) { return i == 0 ? grey(0) : std::string(); });
  REQUIRE(!tests.ok());  // not one mask with a pixel that counts
  const Result<Dataset> no_tests = masked(folder.path(), [&](int i) { return i == 0 ? grey(0) : grey(255); });
  REQUIRE(no_tests.ok());
  CHECK(no_tests->indices(Split::test).empty());
  CHECK(words(*no_tests, "so there are no test views") == 1);
  CHECK(error([](int) {
          return png(8, 2, [](int x, int y) { return std::vector<int>{16 * x, 20 * y, 90}; });
        }).find("black") != std::string::npos);
  CHECK(error([](int) {
          return png(8, 4, [](int x, int y) { return std::vector<int>{x < 8 ? 255 : 0, y < 6 ? 255 : 0}; });
        }).find("different pixels") != std::string::npos);
}

TEST_CASE(
    "scene/mask_reading: a dark mask among others counts whole where it is not black; one of another size is refused") {
  const TemporaryFolder folder;
  const auto grey = [](int value) {
    return png(8, 0, [value](int x, int y) { return std::vector<int>{left(x, y) ? value : 0}; });
  };
  const Result<Dataset> dataset = masked(folder.path(), [&](int i) { return grey(i == 1 ? 1 : 255); });
  REQUIRE(dataset.ok());
  CHECK(words(*dataset, "1 masks have no white pixel, while others have") == 1);
  ImageStore store(*dataset, {});
  for (std::size_t i = 0; i < 4; ++i) {
    const Result<const StoredImage*> image = store.get(i);
    REQUIRE(image.ok());
    CHECK((*image)->mask[0] == 255);
    CHECK((*image)->mask[mask_width - 1] == 0);
  }
  put_image(folder.path() / "masks/2.png", 8, 6, 1);
  const Result<Dataset> other = open_dataset(folder.path(), {});
  REQUIRE(!other.ok());
  CHECK(names(other.error(), "masks/2.png", "image size", "as large as its image"));
}

TEST_CASE("scene/mask_reading: a photograph is no mask") {
  MaskFile photograph{32, 32, 3, 255, {}};
  for (int i = 0; i < 32 * 32; ++i)
    for (const int v : {i % 32 * 8, i / 32 * 8, i % 7 * 30}) photograph.pixels.push_back(static_cast<std::uint16_t>(v));
  const Result<detail::MaskDecision> decision = detail::decide_masks({{"m.png", detail::mask_facts(photograph)}});
  REQUIRE(!decision.ok());
  CHECK(names(decision.error(), "m.png", "mask", "in grey"));
}

TEST_CASE("scene/check_weights: what a mask leaves at the size of the training is looked at before it begins") {
  const TemporaryFolder folder;
  // One white pixel of 192: nothing is left of it at a sixteenth of the width, and less than half at a half.
  const auto dot = [](int i, int value) {
    return png(8, 0, [i, value](int x, int y) { return std::vector<int>{i != 1 && x == 3 && y == 5 ? value : 0}; });
  };
  REQUIRE(masked(folder.path(), [&](int i) { return dot(i, 255); }).ok());
  const auto checked = [&](double downscale, std::size_t trains) {
    DatasetSettings settings;
    settings.downscale = downscale;
    settings.test_every = trains == 0 ? 8 : 0;
    const Result<Dataset> dataset = open_dataset(folder.path(), settings);
    REQUIRE(dataset.ok());
    ImageStore store(*dataset, settings);
    return check_weights(*dataset, store);
  };
  CHECK(checked(1, 0).ok());
  const Result<Done> half = checked(2, 0);
  REQUIRE(!half.ok());
  CHECK(names(half.error(), "masks", "mask", "correct the mask"));
  CHECK(!checked(2, 1).ok());  // without test views training views are measured
  CHECK(!checked(16, 0).ok());
  // Without a mask there is always something.
  REQUIRE(masked(folder.path(), [&](int i) { return i == 1 ? dot(2, 255) : std::string(); }).ok());
  CHECK(checked(16, 0).ok());
}
