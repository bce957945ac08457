// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/image_store: a thousand images of four megapixels stay within the budget (issue: below 2 GiB)") {
  // One file that compresses to nothing stands for all of them; each view is decoded and kept on its own. All together are 12 GB. 80 of
  // them are enough: 67 fill the budget, and from then on one comes for one that goes, so that the 80th leaves the store as the 1,000th
  // would. That this holds for all 1,000 is the test below, with a hundredth of the pixels and of the budget.
  const TemporaryFolder folder;
  ImageBytes grey{2500, 1600, 1, std::vector<std::uint8_t>(2500 * 1600, 77)};
  REQUIRE(write_png(folder.path() / "one.png", grey).ok());
  grey = {};
  std::string frames;
  for (int i = 0; i < 1000; ++i) frames += (i > 0 ? "," : "") + frame_text("one");
  put(folder.path() / "transforms_train.json", transforms_text(frames));
  DatasetSettings settings;
  settings.max_width = 0;
  const Result<Dataset> dataset = open_dataset(folder.path(), settings);
  REQUIRE(dataset.ok());
  REQUIRE(dataset->views.size() == 1000);
  const std::size_t before = peak_memory();
  ImageStore store(*dataset, settings);
  for (std::size_t i = 0; i < 80; ++i) {
    const Result<const StoredImage*> image = store.get(i * 12);
    REQUIRE(image.ok());
    CHECK((*image)->planes[12345] == 77);
    CHECK(store.statistics().bytes <= ImageStoreSettings{}.memory_budget_bytes);
  }
  CHECK(store.statistics().decoded == 80);
  CHECK(store.statistics().evicted == 80 - (std::size_t{768} << 20) / (3 * 2500 * 1600));
  const std::size_t after = peak_memory();
  MESSAGE("peak " << (after >> 20) << " MiB, before any image " << (before >> 20));
  CHECK(after < std::size_t{2} << 30);
}

TEST_CASE("scene/image_store: the budget holds after each of a thousand images, in order and in disorder") {
  const TemporaryFolder folder;
  const ImageBytes grey{250, 160, 1, std::vector<std::uint8_t>(250 * 160, 77)};
  REQUIRE(write_png(folder.path() / "one.png", grey).ok());
  std::string frames;
  for (int i = 0; i < 1000; ++i) frames += (i > 0 ? "," : "") + frame_text("one");
  put(folder.path() / "transforms_train.json", transforms_text(frames));
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  ImageStoreSettings settings;
  settings.memory_budget_bytes /= 100;
  ImageStore store(*dataset, {}, settings);
  const std::size_t image_bytes = 3 * 250 * 160, room = settings.memory_budget_bytes / image_bytes;
  for (std::size_t i = 0; i < 1000; ++i) {
    const std::size_t view = i < 500 ? i : 500 + (i - 500) * 7 % 500;
    const Result<const StoredImage*> image = store.get(view);
    REQUIRE(image.ok());
    REQUIRE((*image)->planes[12345] == 77);
    REQUIRE(store.statistics().bytes == image_bytes * std::min(i + 1, room));
    REQUIRE(store.statistics().bytes <= settings.memory_budget_bytes);
    REQUIRE(store.statistics().evicted == i + 1 - std::min(i + 1, room));
  }
  CHECK(store.statistics().decoded == 1000);
}
