// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as transforms.json, as the photograph that it names, and as that photograph's mask, beside good ones: two
// lengths of 16 bits and a byte of choices, then the three files. A file of no bytes is the good one.
#include "any_capture.hpp"

using namespace compmark;

namespace {

struct Folder {
  std::filesystem::path path = testing::fuzz_folder();
  std::vector<std::byte> photograph, mask;
  const std::string json = testing::capture_json;

  Folder() {
    testing::put_small_image(path / "images/b.png", 8, 6, 3);
    testing::put_small_image(path / "images/a.png", 8, 6, 4);
    testing::put_small_image(path / "masks/a.png", 8, 6, 1);
    photograph = *read_file(path / "images/a.png");
    mask = *read_file(path / "masks/a.png");
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Folder folder;
  testing::FuzzInput input(data, size);
  const std::size_t first = input.word(), second = input.word(), choices = input.byte();
  const auto put = [&](const char* name, std::span<const std::byte> bytes, std::span<const std::byte> good) {
    testing::put_bytes(folder.path / name, bytes.empty() ? good : bytes);
  };
  put("transforms.json", input.bytes(first),
      std::as_bytes(std::span<const char>(folder.json.data(), folder.json.size())));
  put("images/a.png", input.bytes(second), folder.photograph);
  put("masks/a.png", input.rest(), folder.mask);
  testing::look_at_capture(folder.path, choices);
  return 0;
}
