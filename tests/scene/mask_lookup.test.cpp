// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/mask_lookup.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/mask_lookup: the image's own folder below masks, then its name; full name, stem, other capitals") {
  const TemporaryFolder folder;
  const std::filesystem::path& root = folder.path();
  const auto mask = [&](const std::string& image) {
    const std::filesystem::path found = detail::find_mask(root, root / image);
    return found.empty() ? std::string("none") : found.lexically_relative(root).generic_string();
  };
  CHECK(mask("images/a.JPG") == "none");
  put(root / "masks/a.jpg.png", "x");
  CHECK(mask("images/a.JPG") == "masks/a.jpg.png");  // a mask made before the image was renamed
  put(root / "masks/a.JPG", "x");
  CHECK(mask("images/a.JPG") == "masks/a.JPG");
  put(root / "masks/a.PNG", "x");
  CHECK(mask("images/a.JPG") == "masks/a.PNG");
  put(root / "masks/a.JPG.png", "x");
  CHECK(mask("images/a.JPG") == "masks/a.JPG.png");
  CHECK(mask("images_4/a.JPG") == "masks/a.JPG.png");
  put(root / "masks_4/a.png", "x");
  CHECK(mask("images_4/a.JPG") == "masks_4/a.png");
  CHECK(mask("images/a.JPG") == "masks/a.JPG.png");
  put(root / "masks/images/a.png", "x");
  CHECK(mask("images/a.JPG") == "masks/images/a.png");
  put(root / "masks/left/b.png", "x");
  CHECK(mask("images/left/b.jpg") == "masks/left/b.png");
  CHECK(mask("images/right/b.jpg") == "none");
  CHECK(mask("a.JPG") == "masks/a.JPG.png");  // images beside the file of cameras
  // However the folder is written, and for images outside of it: never the image itself as its own mask.
  CHECK(detail::find_mask(root / "." / "masks" / "..", root / "images/left/b.jpg").filename() == "b.png");
  put(root / "scene/masks/c.png", "x");
  put(root / "images/d.png", "x");
  CHECK(detail::find_mask(root / "scene", root / "images/c.jpg") == root / "scene/masks/c.png");
  CHECK(detail::find_mask(root / "scene", root / "images/d.png").empty());
}

TEST_CASE("scene/mask_lookup: a mask that two images could mean is nobody's, with a word; in its folder it is one's") {
  const TemporaryFolder folder;
  put_blender(folder.path());  // train/a train/b test/a
  put_image(folder.path() / "masks/a.png", 16, 12, 1);
  put_image(folder.path() / "masks/b.png", 16, 12, 1);
  const auto open = [&] {
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    REQUIRE(dataset->views.size() == 3);
    return *dataset;
  };
  const Dataset undecided = open();
  CHECK(undecided.views[0].mask_path.empty());
  CHECK(undecided.views[1].mask_path == folder.path() / "masks/b.png");
  CHECK(undecided.views[2].mask_path.empty());
  REQUIRE(undecided.warnings.size() == 2);
  CHECK(undecided.warnings[0].find("masks/a.png\" could be of \"./train/a\" and of \"./test/a\"") != std::string::npos);
  CHECK(undecided.warnings[0].find("masks/train") != std::string::npos);
  CHECK(undecided.warnings[1].find("2 of 3 images have no mask") != std::string::npos);
  put_image(folder.path() / "masks/train/a.png", 16, 12, 1);
  const Dataset decided = open();
  CHECK(decided.views[0].mask_path == folder.path() / "masks/train/a.png");
  CHECK(decided.views[2].mask_path == folder.path() / "masks/a.png");  // the only one left that it could mean
  put_image(folder.path() / "masks/test/a.png", 16, 12, 1);
  const Dataset both = open();
  CHECK(both.views[2].mask_path == folder.path() / "masks/test/a.png");
  CHECK(both.warnings.empty());
}

TEST_CASE(
    "scene/mask_lookup: one image in two frames is one view with its mask, and a mask that frames name is theirs") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  put_image(folder.path() / "masks/a.png", 16, 12, 1);
  put(folder.path() / "transforms_test.json", transforms_text(frame_text("train\\\\a")));
  const Result<Dataset> twice = open_dataset(folder.path(), {});
  REQUIRE(twice.ok());
  CHECK(twice->views[0].mask_path == folder.path() / "masks/a.png");
  CHECK(twice->views.size() == 2);
  const std::string named = R"({"mask_path": "masks\\a.PNG", )";
  put(folder.path() / "transforms_train.json",
      transforms_text(named + frame_text("train/a").substr(1) + "," + named + frame_text("train/b").substr(1)));
  put(folder.path() / "transforms_test.json", transforms_text(named + frame_text("test/a").substr(1)));
  const Result<Dataset> explicitly = open_dataset(folder.path(), {});
  REQUIRE(explicitly.ok());
  for (const View& view : explicitly->views) CHECK(view.mask_path == folder.path() / "masks/a.png");
  CHECK(explicitly->warnings.empty());
}

TEST_CASE("scene/mask_lookup: masks under other names are found by their ends, and those of no image are said") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  const auto open = [&] {
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    return *dataset;
  };
  const auto said = [](const Dataset& dataset, const std::string& words) {
    return std::any_of(dataset.warnings.begin(), dataset.warnings.end(),
                       [&](const std::string& w) { return w.find(words) != std::string::npos; });
  };
  put_image(folder.path() / "Masks/b_mask.png", 16, 12, 1);
  const Dataset named = open();
  CHECK(named.views[1].mask_path == folder.path() / "Masks/b_mask.png");
  CHECK(said(named, "b_mask.png is of \"train/b.png\""));
  put_image(folder.path() / "Masks/other.png", 16, 12, 1);
  put_image(folder.path() / "Masks/a_mask.png", 16, 12, 1);  // of train/a or of test/a
  const Dataset undecided = open();
  CHECK(undecided.views[0].mask_path.empty());
  CHECK(undecided.views[2].mask_path.empty());
  CHECK(said(undecided,
             "2 masks in Masks belong to no image, or to more than one, and are not used, the first is a_mask.png"));
  put_image(folder.path() / "Masks/train/mask-a.jpg.png", 16, 12, 1);
  CHECK(open().views[0].mask_path == folder.path() / "Masks/train/mask-a.jpg.png");
  CHECK(detail::without_mask_affix("x/A.Mask.PNG") == "x/A");
  CHECK(detail::without_mask_affix("mask.png") == "mask");
  CHECK(detail::without_mask_affix("a.b.png") == "a.b");
}

TEST_CASE("scene/mask_lookup: masks in the folders of rigs, and what lies where none is looked for") {
  const TemporaryFolder folder;
  ColmapModel model = small_colmap_model();
  int k = 0;
  for (auto& [id, image] : model.images) {
    image.name = (k % 2 == 0 ? "left/" : "right/") + std::to_string(k / 2) + ".png";
    ++k;
  }
  put_colmap_text(folder.path() / "sparse/0", model);
  put_colmap_images(folder.path() / "images", model);
  const auto open = [&] {
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    return *dataset;
  };
  const auto warnings = [](const Dataset& dataset, const std::string& words) {
    return std::count_if(dataset.warnings.begin(), dataset.warnings.end(),
                         [&](const std::string& w) { return w.find(words) != std::string::npos; });
  };
  put_image(folder.path() / "images/left/0_mask.png", 16, 12, 1);
  put_image(folder.path() / "images/right/dynamic_mask_1.png", 16, 12, 1);
  put_image(folder.path() / "segmentation/0.png", 16, 12, 1);
  const Dataset elsewhere = open();
  CHECK(elsewhere.views.size() == 9);
  CHECK(warnings(elsewhere, "2 masks beside the images are not used") == 1);
  CHECK(warnings(elsewhere, "the images in segmentation are not used") == 1);
  put_image(folder.path() / "images/left/masks/1.png", 16, 12, 1);
  put_image(folder.path() / "images/right/masks/1.png", 16, 12, 1);
  const Dataset rig = open();
  for (const View& view : rig.views) {
    const bool has = view.name == "left/1.png" || view.name == "right/1.png";
    CHECK(view.mask_path == (has ? view.image_path.parent_path() / "masks/1.png" : std::filesystem::path()));
  }
  std::filesystem::remove_all(folder.path() / "images/left/masks");
  std::filesystem::remove_all(folder.path() / "images/right/masks");
  put_image(folder.path() / "masks/1.png", 16, 12, 1);  // of both
  const Dataset shared = open();
  for (const View& view : shared.views) CHECK(view.mask_path.empty());
  CHECK(warnings(shared, "1 masks in masks belong to no image, or to more than one") == 1);
}
