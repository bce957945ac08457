// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/image_folder.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/image_folder: photographs by name, without what a system or a person left beside them") {
  const TemporaryFolder folder;
  CHECK(detail::image_names(folder.path() / "nowhere").empty());
  CHECK(detail::image_names(folder.path()).empty());
  for (const char* name : {"b.png", "a.JPG", "10.jpeg", "9.PNG", "c.jpg", "d.JPEG", "e.png.txt", "f.tif", "notes",
                           "png", ".png", ".hidden.png", "._b.png", "g.Png"})
    put(folder.path() / name, "x");
  std::filesystem::create_directories(folder.path() / "thumbnails.png");
  // Byte order of names, as the published readers sort them: "10" before "9", capitals first.
  CHECK(detail::image_names(folder.path()) ==
        std::vector<std::string>{"10.jpeg", "9.PNG", "a.JPG", "b.png", "c.jpg", "d.JPEG"});
}

TEST_CASE("scene/image_folder: links to photographs are photographs, links to nowhere are not") {
  const TemporaryFolder folder;
  put(folder.path() / "elsewhere/a.png", "x");
  std::filesystem::create_directories(folder.path() / "images");
  std::filesystem::create_symlink(folder.path() / "elsewhere/a.png", folder.path() / "images/a.png");
  std::filesystem::create_symlink(folder.path() / "elsewhere/b.png", folder.path() / "images/b.png");
  CHECK(detail::image_names(folder.path() / "images") == std::vector<std::string>{"a.png"});
}

TEST_CASE(
    "scene/image_folder: the full size comes before its halves, and none is an error that says where to put them") {
  const TemporaryFolder folder;
  const Result<std::filesystem::path> none = detail::image_folder(folder.path());
  REQUIRE(!none.ok());
  CHECK(none.error().kind == ErrorKind::not_found);
  CHECK(names(none.error(), folder.path().string(), "images", (folder.path() / "images").string()));
  put(folder.path() / "images_2", "a file of that name is no folder");
  for (const char* name : {"images_8", "images_4", "images"}) {
    std::filesystem::create_directories(folder.path() / name);
    const Result<std::filesystem::path> found = detail::image_folder(folder.path());
    REQUIRE(found.ok());
    CHECK(*found == folder.path() / name);
  }
}
