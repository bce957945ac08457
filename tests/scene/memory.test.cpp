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
#include "support/short_training.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// A sanitizer decodes as slowly as it does everything: 80 images there, of which 67 fill the budget.
constexpr std::size_t decoded_images = short_trainings ? 80 : 1000;

/// One more name of a file, beside it: a photograph of its own.
std::string another_name(const std::filesystem::path& file, int i) {
  const std::string name = std::to_string(i) + ".png";
  std::filesystem::create_hard_link(file, file.parent_path() / name);
  return name;
}

}  // namespace

TEST_CASE("scene/image_store: a thousand images of four megapixels stay below 2 GiB (80 of them under a sanitizer)") {
  // One grey PNG, the cheapest file to decode, stands for all of them; each view is decoded and kept on its own. All
  // together are 12 GB.
  const TemporaryFolder folder;
  constexpr std::size_t width = 2500, height = 1600;
  ImageBytes grey{width, height, 1, std::vector<std::uint8_t>(width * height, 77)};
  REQUIRE(write_png(folder.path() / "one.png", grey).ok());
  grey = {};
  std::string frames;
  for (int i = 0; i < 1000; ++i) frames += (i > 0 ? "," : "") + frame_text(another_name(folder.path() / "one.png", i));
  put(folder.path() / "transforms_train.json", transforms_text(frames));
  DatasetSettings settings;
  settings.max_width = 0;
  const Result<Dataset> dataset = open_dataset(folder.path(), settings);
  REQUIRE(dataset.ok());
  REQUIRE(dataset->views.size() == 1000);
  const std::size_t before = peak_memory();
  ImageStore store(*dataset, settings);
  for (std::size_t i = 0; i < decoded_images; ++i) {
    const Result<const StoredImage*> image = store.get(i * 7 % 1000);  // every view once, in disorder
    REQUIRE(image.ok());
    REQUIRE((*image)->planes.size() == 3 * width * height);
    REQUIRE((*image)->planes[12345] == 77);
    REQUIRE(store.statistics().bytes <= ImageStoreSettings{}.memory_budget_bytes);
  }
  CHECK(store.statistics().decoded == decoded_images);
  CHECK(store.statistics().evicted == decoded_images - (std::size_t{768} << 20) / (3 * width * height));
  const std::size_t after = peak_memory();
  MESSAGE(decoded_images << " decoded, peak " << (after >> 20) << " MiB, before any image " << (before >> 20));
  CHECK(after < std::size_t{2} << 30);
}

TEST_CASE("scene/image_store: the budget holds after each of a thousand images, in order and in disorder") {
  const TemporaryFolder folder;
  const ImageBytes grey{250, 160, 1, std::vector<std::uint8_t>(250 * 160, 77)};
  REQUIRE(write_png(folder.path() / "one.png", grey).ok());
  std::string frames;
  for (int i = 0; i < 1000; ++i) frames += (i > 0 ? "," : "") + frame_text(another_name(folder.path() / "one.png", i));
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
