// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/transforms_split.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <string>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/transforms_split: what is in no list that is used, or in two, is said with its number") {
  const CubeCapture capture = cube_capture();
  const TemporaryFolder folder;
  put_cube_images(folder.path() / "images", capture);
  const auto list = [](std::size_t from, std::size_t to) {
    std::string text;
    for (std::size_t i = from; i < to; ++i) text += (i > from ? ", \"images/" : "\"images/") + cube_image(i) + "\"";
    return "[" + text + "]";
  };
  const auto opened = [&](const std::string& lists) {
    put(folder.path() / "transforms.json", cube_transforms(capture, R"("fl_x": 20, "w": 16, "h": 12, )" + lists,
                                                           [](std::size_t i) { return "images/" + cube_image(i); }));
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    std::string text = std::to_string(dataset->indices(Split::train).size()) + "+" +
                       std::to_string(dataset->indices(Split::test).size());
    for (const std::string& warning : dataset->warnings) text += "\n" + warning;
    return text;
  };
  const auto has = [](const std::string& text, const std::string& words) {
    return text.find(words) != std::string::npos;
  };
  const std::string whole = opened(R"("train_filenames": )" + list(0, 10) + R"(, "test_filenames": )" + list(10, 12));
  CHECK(whole.substr(0, 4) == "10+2");
  CHECK(!has(whole, "filenames"));
  const std::string val = opened(R"("train_filenames": )" + list(0, 6) + R"(, "val_filenames": )" + list(6, 9) +
                                 R"(, "test_filenames": )" + list(9, 11));
  CHECK(val.substr(0, 3) == "6+2");
  CHECK(has(
      val,
      "4 images are in neither train_filenames nor test_filenames and are left out, the first is \"images/06.png\""));
  const std::string two = opened(R"("train_filenames": )" + list(0, 9) + R"(, "test_filenames": )" + list(7, 12));
  CHECK(two.substr(0, 3) == "9+3");
  CHECK(has(two, "2 images are in two lists"));
  CHECK(has(two, "the first is \"images/07.png\""));
  CHECK(!has(two, "left out"));
  // Twice in one list is once.
  CHECK(!has(opened(R"("train_filenames": )" + list(0, 12).substr(0, list(0, 12).size() - 1) + R"(, "images/00.png"])"),
             "two lists"));
}
