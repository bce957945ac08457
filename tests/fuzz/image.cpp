// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as an image file, and as the chunks of a PNG (whose checksums stb_image does not look at, so they need no
// mending): decoded whole within its limit, or refused. As a mask of 16 bits too.
#include <compmark/io/image_file.hpp>
#include <compmark/scene/mask_file.hpp>

#include "any_tensors.hpp"

namespace {

using namespace compmark;
constexpr std::uint64_t limit = std::uint64_t{64} << 20;

void look(std::span<const std::byte> bytes) {
  const Result<ImageInfo> info = decode_image_info(bytes, "fuzz");
  const Result<ImageBytes> image = decode_image(bytes, "fuzz", limit);
  if (!image) {
    testing::require_words(image.error());
    return;
  }
  if (!info || info->width != image->width || info->height != image->height || image->channels < 1 ||
      image->channels > 4 ||
      image->pixels.size() != static_cast<std::size_t>(image->width) * static_cast<std::size_t>(image->height) *
                                  static_cast<std::size_t>(image->channels))
    std::abort();
  // The same bytes give the same pixels: none of them is what lay in memory.
  const Result<ImageBytes> again = decode_image(bytes, "fuzz", limit);
  if (!again || again->pixels != image->pixels) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span<const std::uint8_t>(data, size));
  look(bytes);
  static const std::filesystem::path path = testing::fuzz_folder() / "mask.png";
  const Result<ImageInfo> info = decode_image_info(bytes, "fuzz");
  if (!info || info->bits != 16 || std::int64_t{info->width} * info->height > (1 << 20)) return 0;
  testing::put_bytes(path, bytes);
  const Result<MaskFile> mask = read_mask_file(path);
  if (!mask) {
    testing::require_words(mask.error());
    return 0;
  }
  if (mask_weights(*mask, MaskReading::any_alpha).size() != mask->size()) std::abort();
  return 0;
}
