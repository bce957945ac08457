// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/files.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/image_file.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "support/tool.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

void write_grey(const fs::path& path, float value) {
  std::vector<float> grey(3 * 16, value);
  REQUIRE(write_png(path, ImageView<const float>{grey.data(), 3, 4, 4}).ok());
}

}  // namespace

TEST_CASE("app/files: a file's digest is that of its bytes, and a file that is not there is an error") {
  const testing::ScratchFolder folder("compmark-app-digest");
  REQUIRE(write_file(folder.path / "abc", std::string("abc")).ok());
  // FIPS 180-4, appendix: the digest of "abc".
  CHECK(*file_sha256(folder.path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(file_sha256(folder.path / "none").error().kind == ErrorKind::not_found);
}

TEST_CASE("app/files: the digest of pixels tells images apart that differ by one level, and no less") {
  std::vector<float> image(3 * 4, 0.5f), other = image;
  const auto digest = [](const std::vector<float>& pixels) {
    return pixels_sha256(ImageView<const float>{pixels.data(), 3, 2, 2});
  };
  other[7] += 0.1f / 255;
  CHECK(digest(image) == digest(other));
  other[7] += 1.0f / 255;
  CHECK(digest(image) != digest(other));
}

TEST_CASE("app/files: a folder stands for its PNG and JPEG files by name, and a name that is not there is refused") {
  const testing::ScratchFolder folder("compmark-app-images");
  for (const char* name : {"b.png", "a.PNG", ".hidden.png"}) write_grey(folder.path / name, 0.5f);
  REQUIRE(write_file(folder.path / "words.txt", std::string("words")).ok());
  const auto files = image_files({folder.path / "words.txt", folder.path});
  REQUIRE(files.ok());
  REQUIRE(files->size() == 3);  // a file that is named is taken as it is
  CHECK((*files)[1].filename() == "a.PNG");
  CHECK((*files)[2].filename() == "b.png");
  CHECK(image_files({folder.path / "none"}).error().kind == ErrorKind::not_found);
  fs::create_directory(folder.path / "empty");
  CHECK(image_files({folder.path / "empty"}).error().problem.find("no PNG or JPEG") != std::string::npos);
}

TEST_CASE("app/files: the memory of an image is asked for before it is decoded") {
  ImageInfo info;
  info.width = 1000;
  info.height = 500;
  CHECK(check_image_memory(info, "a.png", 56, 27).ok());  // 28,000,000 bytes are 26.7 MiB
  const Result<Done> refused = check_image_memory(info, "a.png", 56, 26);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK(refused.error().remedy.find("27") != std::string::npos);
}
