// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/io/ply.hpp>
#include <compmark/io/safetensors_reader.hpp>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <fstream>
#include <optional>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// The error of a case, or nothing if it is accepted.
std::optional<Error> refusal(const std::filesystem::path& folder) {
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".safetensors") {
      const Result<SafetensorsFile> file = read_safetensors(entry.path());
      return file.ok() ? std::nullopt : std::optional<Error>(file.error());
    }
    if (entry.path().filename() == "splats.ply") {
      const Result<PlyFile> file = read_ply(entry.path());
      return file.ok() ? std::nullopt : std::optional<Error>(file.error());
    }
  }
  const Result<Dataset> dataset = open_dataset(folder, {});
  if (!dataset) return dataset.error();
  ImageStore store(*dataset, {});
  for (std::size_t i = 0; i < store.size(); ++i) {
    if (const Result<const StoredImage*> image = store.get(i); !image) return image.error();
  }
  return std::nullopt;
}

}  // namespace

TEST_CASE("scene/refuse: every malformed file gets one line with file, field and remedy, and no memory") {
  const std::filesystem::path root = "tests/golden/refuse";
  REQUIRE(std::filesystem::is_directory(root));
  std::vector<std::filesystem::path> cases;
  for (const auto& entry : std::filesystem::directory_iterator(root)) {
    if (entry.is_directory()) cases.push_back(entry.path());
  }
  std::sort(cases.begin(), cases.end());
  CHECK(cases.size() >= 50);
  const std::size_t before = peak_memory();
  for (const std::filesystem::path& folder : cases) {
    CAPTURE(folder.filename().string());
    std::ifstream expected(folder / "expected.txt");
    std::string file, field, remedy;
    REQUIRE(std::getline(expected, file));
    std::getline(expected, field);
    std::getline(expected, remedy);
    const std::optional<Error> error = refusal(folder);
    REQUIRE(error.has_value());
    CAPTURE(error->line());
    CHECK(names(*error, file, field, remedy));
    CHECK(!error->remedy.empty());
  }
  // The largest of these files has 5 KB and several ask for 2^60 records: all of them together take less than a
  // decoder's buffers.
  CHECK(peak_memory() < before + (std::size_t{64} << 20));
}

TEST_CASE("scene/refuse: references in circles are missing files") {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.path() / "images");
  std::filesystem::create_symlink("b.png", folder.path() / "images/a.png");
  std::filesystem::create_symlink("a.png", folder.path() / "images/b.png");
  put(folder.path() / "transforms.json", transforms_text(frame_text("images/a.png")));
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(!dataset.ok());
  CHECK(names(dataset.error(), "transforms.json", "frames[0].file_path", "add the image"));
  std::filesystem::create_symlink(folder.path(), folder.path() / "sparse");  // a folder that contains itself
  CHECK(!open_dataset(folder.path(), {}).ok());
}

TEST_CASE("scene/refuse: a photograph whose name is no text, before there is a report to write it into") {
  const TemporaryFolder folder;
  ColmapModel model = small_colmap_model();
  model.images.begin()->second.name = "caf\xE9.png";  // Latin-1
  put_colmap_binary(folder.path() / "sparse/0", model);
  put_colmap_images(folder.path() / "images", model);
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(!dataset.ok());
  CHECK(names(dataset.error(), folder.path().filename().string(), "images", "rename it"));
  CHECK(dataset.error().problem.find("caf?.png") != std::string::npos);
  std::filesystem::remove_all(folder.path() / "images");
  model.images.begin()->second.name = "caf\xC3\xA9.png";
  put_colmap_binary(folder.path() / "sparse/0", model);
  put_colmap_images(folder.path() / "images", model);
  CHECK(open_dataset(folder.path(), {}).ok());
}
