// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/core/random.hpp>
#include <compmark/io/image_file.hpp>

// A program's own copy of stb, after ours and with its own options: it must still compile and be the complete one.
#pragma GCC diagnostic push
#if defined(__clang__)
#pragma clang diagnostic ignored "-Weverything"
#else
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wconversion"
#endif
#include <stb/stb_image.h>
#pragma GCC diagnostic pop
static_assert(sizeof(&::stbi_load) > 0, "stb's own stdio functions are declared, though ours are compiled without");

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "support/png_text.hpp"
#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

ImageBytes noise_image(int width, int height, int channels) {
  const Random random(3, 0, random_stage("image file test"));
  ImageBytes image{width, height, channels, {}};
  for (std::size_t i = 0; i < static_cast<std::size_t>(width * height * channels); ++i)
    image.pixels.push_back(static_cast<std::uint8_t>(random.below(i, 256)));
  return image;
}

}  // namespace

TEST_CASE("io/image_file: the header of a PNG with a transparent colour says the channels that decoding gives") {
  const auto pixel = [](int type) {
    return [type](int x, int y) {
      std::vector<int> values{10 * x, 10 * y, 30};
      values.resize(type == 0 || type == 3 ? 1 : 3);
      if (type == 3) values[0] = x % 2;
      return values;
    };
  };
  const std::string two_colors("\1\2\3\4\5\6", 6);
  for (const int type : {0, 2, 3}) {
    for (const int bits : {8, 16}) {
      if (type == 3 && bits == 16) continue;
      for (const bool transparent : {false, true}) {
        CAPTURE(type);
        CAPTURE(bits);
        CAPTURE(transparent);
        const std::string key = type == 3 ? std::string("\0\377", 2) : std::string(type == 0 ? 2 : 6, '\0');
        const std::string text =
            png_text(3, 2, bits, type, pixel(type), type == 3 ? two_colors : "", transparent ? key : "");
        const std::span<const std::byte> bytes = std::as_bytes(std::span<const char>(text));
        const Result<ImageInfo> info = decode_image_info(bytes, "x.png");
        const Result<ImageBytes> image = decode_image(bytes, "x.png");
        REQUIRE(info.ok());
        REQUIRE(image.ok());
        CHECK(image->channels == (type == 0 ? 1 : 3) + (transparent ? 1 : 0));
        CHECK(info->channels == image->channels);
        CHECK(info->has_alpha() == transparent);
        CHECK(info->bits == bits);
        // A file that is cut anywhere is an error or not, but never more than there is.
        for (std::size_t size = 0; size < text.size(); ++size)
          static_cast<void>(decode_image_info(bytes.first(size), "x.png"));
      }
    }
  }
}

TEST_CASE("io/image_file: PNG keeps every byte, for 1 to 4 channels and odd sizes") {
  const TemporaryFolder folder;
  for (int channels = 1; channels <= 4; ++channels) {
    for (const int width : {1, 7, 64}) {
      const ImageBytes image = noise_image(width, 5, channels);
      const std::filesystem::path path = folder.path() / "image.png";
      REQUIRE(write_png(path, image).ok());
      const Result<ImageBytes> read = read_image(path);
      REQUIRE(read.ok());
      CHECK(read->width == width);
      CHECK(read->height == 5);
      CHECK(read->channels == channels);
      CHECK(read->pixels == image.pixels);
      const Result<ImageInfo> info = read_image_info(path);
      REQUIRE(info.ok());
      CHECK(info->channels == channels);
      CHECK(info->has_alpha() == (channels % 2 == 0));
    }
  }
}

TEST_CASE("io/image_file: JPEG keeps a smooth picture within its quality") {
  ImageBytes image{64, 48, 3, {}};
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      for (int c = 0; c < 3; ++c) image.pixels.push_back(static_cast<std::uint8_t>(60 + 2 * x + y - 10 * c));
    }
  }
  double previous = 1e9;
  for (const int quality : {20, 60, 95}) {
    const Result<ImageBytes> read = decode_image(encode_jpeg(image, quality), "memory");
    REQUIRE(read.ok());
    REQUIRE(read->pixels.size() == image.pixels.size());
    double sum = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      sum += std::pow(static_cast<double>(read->pixels[i]) - image.pixels[i], 2);
    CHECK(sum < previous);
    previous = sum;
  }
  CHECK(std::sqrt(previous / static_cast<double>(image.pixels.size())) <
        2);  // levels, at quality 95: a loose bound, not derived
}

TEST_CASE("io/image_file: a truncated file is an error wherever it is cut, never a partly grey picture") {
  const ImageBytes image = noise_image(40, 30, 3);
  for (const bool png : {true, false}) {
    const std::vector<std::byte> bytes = png ? encode_png(image) : encode_jpeg(image, 90);
    // The last bytes hold only checksums and end marks, which carry no pixel.
    for (std::size_t length = 0; length + 64 < bytes.size(); length += 1 + length / 50) {
      CAPTURE(png);
      CAPTURE(length);
      const Result<ImageBytes> read = decode_image(std::span<const std::byte>(bytes).first(length), "cut");
      REQUIRE(!read.ok());
      CHECK(names(read.error(), "cut", "", length == 0 ? "copy it again" : ""));
      CHECK(!read.error().remedy.empty());
    }
  }
}

TEST_CASE("io/image_file: bytes that are no image, missing files and giants are refused by name") {
  const TemporaryFolder folder;
  CHECK(names(read_image(folder.path() / "none.png").error(), "none.png", "", "check the path"));
  CHECK(names(read_image(folder.path()).error(), folder.path().string(), "", "name of a file"));
  put(folder.path() / "text.png", "this is text, not a picture");
  CHECK(names(read_image(folder.path() / "text.png").error(), "text.png", "", "PNG or JPEG"));
  put(folder.path() / "empty.png", "");
  CHECK(names(read_image_info(folder.path() / "empty.png").error(), "empty.png", "", "copy it again"));
  // The header of a 60000 x 60000 PNG: 3.6 gigapixels promised by 33 bytes.
  std::vector<std::byte> giant = encode_png(noise_image(4, 4, 3));
  for (const std::size_t field : {std::size_t{16}, std::size_t{20}}) {
    giant[field + 2] = std::byte{0xEA};
    giant[field + 3] = std::byte{0x60};
  }
  const Result<ImageBytes> read = decode_image(giant, "giant");
  REQUIRE(!read.ok());
  CHECK(read.error().kind == ErrorKind::exhausted);
  CHECK(names(read.error(), "giant", "", "scale it down"));
  CHECK(!write_png(folder.path() / "missing" / "a.png", noise_image(2, 2, 3)).ok());
}

TEST_CASE("io/image_file: damaged bytes never crash the decoder") {
  const Random random(5, 0, random_stage("image damage"));
  for (const bool png : {true, false}) {
    const std::vector<std::byte> bytes =
        png ? encode_png(noise_image(16, 16, 4)) : encode_jpeg(noise_image(16, 16, 3), 80);
    for (std::uint64_t round = 0; round < 300; ++round) {
      std::vector<std::byte> damaged = bytes;
      for (std::uint64_t k = 0; k < 4; ++k) {
        damaged[random.below(16 * round + 2 * k, damaged.size())] =
            static_cast<std::byte>(random.below(16 * round + 2 * k + 1, 256));
      }
      const Result<ImageBytes> read = decode_image(damaged, "damaged");
      if (read.ok())
        CHECK(read->pixels.size() ==
              static_cast<std::size_t>(read->width) * static_cast<std::size_t>(read->height * read->channels));
    }
  }
}

TEST_CASE("io/image_file: floats are rounded to the nearest byte, clamped, NaN is black") {
  const std::vector<float> values{
      0.0f,       1.0f,       0.5f,         -3.0f, 7.0f, std::numeric_limits<float>::quiet_NaN(),
      1.4f / 255, 1.6f / 255, 254.4f / 255, 0,     0,    0};
  const ImageBytes bytes = to_bytes(ImageView<const float>{values.data(), 3, 1, 4});
  CHECK(bytes.channels == 3);
  // planar [3][4] to interleaved: pixel x has values x, x + 4, x + 8
  CHECK(bytes.pixels == std::vector<std::uint8_t>{0, 255, 254, 255, 0, 0, 128, 1, 0, 0, 2, 0});
}
