// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/image_lookup.hpp"

#include <doctest/doctest.h>

#include <set>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/image_lookup: every spelling of an extension once, small letters and capitals before mixed ones") {
  const auto jpg = detail::other_capitals("a/b.JPG");
  REQUIRE(jpg.size() == 7);  // 2^3 without the one that was given
  CHECK(jpg[0] == "a/b.jpg");
  CHECK(detail::other_capitals("b.jpg")[0] == "b.JPG");
  CHECK(std::set<std::filesystem::path>(jpg.begin(), jpg.end()).size() == 7);
  CHECK(detail::other_capitals("b.jpeg").size() == 15);
  CHECK(detail::other_capitals("B.Png").size() == 7);
  CHECK(detail::other_capitals("B.Png")[1] == "B.PNG");  // the name itself keeps its capitals
  for (const char* other : {"a", "a.", ".png", "a.tif", "a.0001", ""}) CHECK(detail::other_capitals(other).empty());
}

TEST_CASE("scene/image_lookup: the exact name, then other capitals, then an appended extension, then smaller copies") {
  const TemporaryFolder folder;
  const std::filesystem::path& root = folder.path();
  const auto found = [&](const std::string& name) {
    const detail::FoundImage image = detail::find_image(root, name);
    return std::pair<std::string, int>(image.path.lexically_relative(root).generic_string(), image.reduction);
  };
  using Found = std::pair<std::string, int>;
  CHECK(detail::find_image(root, "images/a.jpg").path.empty());
  CHECK(detail::find_image(root, "").path.empty());
  // From the last choice to the first.
  put(root / "images_8/a.jpg", "x");
  CHECK(found("images/a.jpg") == Found("images_8/a.jpg", 8));
  put(root / "images_4/a.JPG", "x");
  CHECK(found("images/a.jpg") == Found("images_4/a.JPG", 4));
  put(root / "images/a.jpg.png", "x");
  CHECK(found("images/a.jpg") == Found("images/a.jpg.png", 1));
  put(root / "images/a.jPg", "x");
  put(root / "images/a.Jpg", "x");
  const Found mixed = found("images/a.jpg");
  CHECK(mixed == found(".\\images\\a.JPG"));  // one choice, whatever was written
  put(root / "images/a.JPG", "x");
  CHECK(found("images/a.jpg") == Found("images/a.JPG", 1));
  CHECK(found("images/a.JPg") == Found("images/a.JPG", 1));
  put(root / "images/a.jpg", "x");
  CHECK(found("images/a.jpg") == Found("images/a.jpg", 1));
  CHECK(found("images/a.JPG") == Found("images/a.JPG", 1));  // exact
  CHECK(found("images/a") == Found("images/a.jpg", 1));
  std::filesystem::create_directories(root / "images/b.png");  // a folder is no image
  CHECK(detail::find_image(root, "images/b.PNG").path.empty());
  put(root / "images/c.JPEG", "x");
  put(root / "images/d.PNG", "x");
  CHECK(found("images/c.jpeg") == Found("images/c.JPEG", 1));
  CHECK(found("images/d.png") == Found("images/d.PNG", 1));
  CHECK(detail::find_image(root, "images/C.jpeg").path.empty());  // another name is another image
}
