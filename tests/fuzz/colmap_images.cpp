// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as the three text files of a COLMAP model and as the name of one photograph, beside photographs: two
// lengths of 16 bits, a byte of choices and a name, then the files. A file of no bytes is the good one. Its binary
// files have colmap.cpp.
#include <algorithm>

#include "any_capture.hpp"

using namespace compmark;

namespace {

struct Folder {
  std::filesystem::path path = testing::fuzz_folder();
  const std::string cameras = testing::colmap_cameras, images = testing::colmap_images, points = testing::colmap_points;

  Folder() {
    for (const char* name : {"images/a.png", "images/c.png", "images/d.png", "images/sub/b.jpg"})
      testing::put_small_image(path / name, 8, 6, 3);
    std::filesystem::create_directories(path / "sparse/0");
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Folder folder;
  testing::FuzzInput input(data, size);
  const std::size_t first = input.word(), second = input.word(), choices = input.byte();
  std::string name = input.text(choices % 16);
  std::replace(name.begin(), name.end(), '\0', '_');
  std::replace(name.begin(), name.end(), '/', '_');
  const auto put = [&](const char* file, std::span<const std::byte> bytes, const std::string& good) {
    testing::put_bytes(folder.path / "sparse/0" / file,
                       bytes.empty() ? std::as_bytes(std::span<const char>(good.data(), good.size())) : bytes);
  };
  put("cameras.txt", input.bytes(first), folder.cameras);
  put("images.txt", input.bytes(second), folder.images);
  put("points3D.txt", input.rest(), folder.points);
  const bool renamed =
      !name.empty() && name != "." && name != ".." && name != "sub" && name != "a.png" && name != "d.png";
  const std::filesystem::path own = folder.path / "images/c.png", other = folder.path / "images" / name;
  if (renamed) std::filesystem::rename(own, other);
  testing::look_at_capture(folder.path, choices);
  if (renamed) std::filesystem::rename(other, own);
  return 0;
}
