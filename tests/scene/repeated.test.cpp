// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/repeated.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

bool has_words(const Dataset& dataset, const std::string& words) {
  return std::any_of(dataset.warnings.begin(), dataset.warnings.end(),
                     [&](const std::string& w) { return w.find(words) != std::string::npos; });
}

}  // namespace

TEST_CASE("scene/repeated: a test view is no training view, whatever the photograph is called") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  std::filesystem::create_directory_symlink(folder.path() / "train", folder.path() / "link");
  for (const char* same : {"train/a", "./train/a.png", "test/../train/a.png", "link/a.png"}) {
    CAPTURE(same);
    put(folder.path() / "transforms_test.json", transforms_text(frame_text("test/a") + "," + frame_text(same)));
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    CHECK(dataset->indices(Split::train).size() == 2);
    CHECK(dataset->indices(Split::test).size() == 1);
    CHECK(has_words(*dataset, "1 frames have the photograph of another frame and are left out"));
  }
  // Two poses of one photograph: which is right cannot be known.
  put(folder.path() / "transforms_test.json",
      transforms_text(frame_text("train/a", "[[1,0,0,1],[0,1,0,0],[0,0,1,4],[0,0,0,1]]")));
  const Result<Dataset> two_poses = open_dataset(folder.path(), {});
  REQUIRE(!two_poses.ok());
  CHECK(names(two_poses.error(), "transforms_train.json", "train/a", "one frame"));
}

TEST_CASE("scene/repeated: a photograph copied under another name is said where it tests what it trained") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  put_image(folder.path() / "train/b.png", 16, 12, 4, 99);
  const Result<Dataset> copied = open_dataset(folder.path(), {});  // train/a and test/a are one picture
  REQUIRE(copied.ok());
  CHECK(copied->views.size() == 3);
  CHECK(has_words(*copied,
                  "1 test photographs are training photographs under another name (\"./test/a\" is \"./train/a\")"));
  put_image(folder.path() / "test/a.png", 16, 12, 4, 98);
  const Result<Dataset> different = open_dataset(folder.path(), {});
  REQUIRE(different.ok());
  CHECK(different->warnings.empty());
}
