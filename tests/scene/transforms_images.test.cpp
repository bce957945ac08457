// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/transforms_images.hpp"

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/transforms_images: names of frames, whatever the frames are") {
  using FileNames = std::vector<std::string>;
  const auto names_of = [](const char* text) { return detail::frame_names(nlohmann::json::parse(text)); };
  CHECK(names_of(R"({"frames": [{"file_path": "a"}, {}, 3, {"file_path": 4}, {"file_path": "b"}]})") ==
        FileNames{"a", "", "", "", "b"});
  CHECK(names_of(R"({"frames": 3})").empty());
  CHECK(names_of("[]").empty());
}

TEST_CASE("scene/transforms_images: folders of smaller copies are the folder, at one reduction only") {
  CHECK(detail::path_of_reduction("images_4/x/a.png", 4) == "images/x/a.png");
  CHECK(detail::path_of_reduction("images_4/a.png", 2).empty());
  CHECK(detail::path_of_reduction("images_4/a.png", 1).empty());
  CHECK(detail::path_of_reduction("images/a.png", 1) == "images/a.png");
  CHECK(detail::path_of_reduction("images/a.png", 4).empty());
  CHECK(detail::path_of_reduction("_4/a.png", 1) == "_4/a.png");  // nothing is before the number
  CHECK(detail::path_of_reduction("a_4.png", 1) == "a_4.png");
}

TEST_CASE("scene/transforms_images: full size before smaller copies, and what one frame names is no other frame's") {
  const TemporaryFolder folder;
  for (const char* name : {"images/a.png", "images_2/a.png", "images_4/b.jpg", "photos/c.png", "images_2/d.png"})
    put(folder.path() / name, "x");
  std::vector<std::string> notes;
  const std::vector<std::string> names{"images/a.png", "images/b.png",   "c.png",
                                       "images/d",     "images_2/a.png", "images/z.png"};
  const std::vector<detail::FoundImage> found = detail::find_frame_images(folder.path(), names, notes);
  REQUIRE(found.size() == names.size());
  const auto is = [&](std::size_t i, const char* path, int reduction) {
    return found[i].path.lexically_relative(folder.path()) == path && found[i].reduction == reduction;
  };
  CHECK(is(0, "images/a.png", 1));
  CHECK(is(1, "images_4/b.jpg", 4));  // another extension: by the end of its path
  CHECK(is(2, "photos/c.png", 1));
  CHECK(is(3, "images_2/d.png", 2));
  CHECK(found[4].path == folder.path() / "images_2/a.png");
  CHECK(found[5].path.empty());
  CHECK(!notes.empty());
  // Where images/a.png is missing, the copy that another frame names is not taken for it.
  std::filesystem::remove(folder.path() / "images/a.png");
  CHECK(detail::find_frame_images(folder.path(), names, notes)[0].path.empty());
}
