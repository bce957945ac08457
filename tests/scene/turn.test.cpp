// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/open.hpp>

#include <algorithm>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// A JPEG with an Exif block that holds an orientation, in either byte order.
std::string jpeg_with_orientation(int width, int height, int orientation, bool little) {
  ImageBytes image{width, height, 3, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      for (const int v : {200 * x / width, 200 * y / height, 40}) image.pixels.push_back(static_cast<std::uint8_t>(v));
  }
  const std::vector<std::byte> bytes = encode_jpeg(image, 95);
  std::string file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const char o = static_cast<char>(orientation);
  const std::string tiff =
      little ? std::string("II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0", 18) + std::string({o, 0, 0, 0, 0, 0, 0, 0})
             : std::string("MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01", 18) + std::string({0, o, 0, 0, 0, 0, 0, 0});
  const std::string body = std::string("Exif\0\0", 6) + tiff;
  const std::size_t length = body.size() + 2;
  const std::string segment =
      std::string("\xFF\xE1") + static_cast<char>(length >> 8) + static_cast<char>(length & 255) + body;
  return file.substr(0, 2) + segment + file.substr(2);
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span<const char>(text.data(), text.size()));
}

}  // namespace

TEST_CASE("io/exif: the orientation is found in both byte orders, and no offset is followed out of the file") {
  for (int orientation = 1; orientation <= 8; ++orientation) {
    for (const bool little : {true, false}) {
      const std::string file = jpeg_with_orientation(24, 16, orientation, little);
      CHECK(jpeg_orientation(bytes_of(file)) == orientation);
      const Result<ImageInfo> info = decode_image_info(bytes_of(file), "x");
      REQUIRE(info.ok());
      CHECK(info->orientation == orientation);
      CHECK(info->width == 24);  // as stored
    }
  }
  const std::string file = jpeg_with_orientation(24, 16, 6, true);
  for (std::size_t length = 0; length < 60; ++length) {
    const int cut = jpeg_orientation(bytes_of(file).first(length));
    CHECK((cut == 1 || cut == 6));
  }
  for (std::size_t i = 2; i < 46; ++i) {  // any byte of the block damaged: an answer in range
    for (const char value : {'\0', '\x7F', '\xFF'}) {
      std::string damaged = file;
      damaged[i] = value;
      const int answer = jpeg_orientation(bytes_of(damaged));
      CHECK((answer >= 1 && answer <= 8));
    }
  }
  CHECK(jpeg_orientation(bytes_of("\x89PNG\r\n\x1A\n")) == 1);
}

TEST_CASE("scene/turn: the eight orientations") {
  // A 3 x 2 image of letters, and what a viewer shows (Exif 2.32, table of orientations).
  const ImageBytes stored{3, 2, 1, {'a', 'b', 'c', 'd', 'e', 'f'}};
  const std::array<std::string, 9> shown{"",       "abcdef", "cbafed", "fedcba", "defabc",
                                         "adbecf", "daebfc", "fcebda", "cfbead"};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const ImageBytes image = turned(stored, orientation);
    CHECK(std::string(image.pixels.begin(), image.pixels.end()) == shown[static_cast<std::size_t>(orientation)]);
    CHECK(image.width == (orientation <= 4 ? 3 : 2));
  }
}

TEST_CASE("scene/turn: an image is turned where its camera is for the turned image, and only there") {
  const TemporaryFolder folder;
  const CubeCapture capture = cube_capture(1, {0, 0, 0}, 2);
  put(folder.path() / "images/00.jpg", jpeg_with_orientation(12, 16, 6, true));  // stored upright, shown 16 x 12
  put(folder.path() / "images/01.jpg", jpeg_with_orientation(16, 12, 3, false));
  const auto open = [&](const std::string& size) {
    put(folder.path() / "transforms.json", cube_transforms(capture, "\"fl_x\": 20, " + size, [](std::size_t i) {
          return "images/" + cube_image(i).substr(0, 2);
        }));
    return open_dataset(folder.path(), {});
  };
  const Result<Dataset> dataset = open("\"w\": 16, \"h\": 12");
  REQUIRE(dataset.ok());
  CHECK(dataset->views[0].orientation == 6);
  CHECK(dataset->views[1].orientation == 1);  // nothing tells that the camera is for the turned one
  CHECK(dataset->views[0].camera.width == 16);
  CHECK(dataset->warnings.size() == 3);  // turned, not turned, no points
  ImageStore store(*dataset, {});
  const StoredImage image = **store.get(0);
  CHECK(image.width == 16);
  CHECK(image.view()(1, 6, 0) > 150);  // green grows down the stored image, whose top is shown on the right
  CHECK(image.view()(1, 6, 15) < 50);
  CHECK(names(open("\"w\": 16, \"h\": 5").error(), "00.jpg", "image size", "neither cropped nor rotated"));
}

TEST_CASE("scene/turn: images of 16 bits a channel are used with their upper 8, and it is said") {
  // A PNG with one stored deflate block. stb does not look at the checksums.
  const auto chunk = [](const std::string& name, const std::string& body) {
    std::string text;
    for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(body.size() >> shift & 255);
    return text + name + body + std::string(4, '\0');
  };
  std::string rows;
  for (int y = 0; y < 12; ++y) {
    rows += '\0';
    for (int i = 0; i < 16 * 3; ++i) rows += std::string({static_cast<char>(i), '\x7F'});
  }
  std::string zlib("\x78\x01\x01", 3);
  for (const std::size_t n : {rows.size(), ~rows.size()}) {
    zlib += static_cast<char>(n & 255);
    zlib += static_cast<char>(n >> 8 & 255);
  }
  zlib += rows + std::string(4, '\0');
  const std::string png = "\x89PNG\r\n\x1A\n" + chunk("IHDR", std::string("\0\0\0\x10\0\0\0\x0C\x10\x02\0\0\0", 13)) +
                          chunk("IDAT", zlib) + chunk("IEND", "");
  const TemporaryFolder folder;
  put(folder.path() / "images/00.png", png);
  const CubeCapture capture = cube_capture(1, {0, 0, 0}, 1);
  put(folder.path() / "transforms.json",
      cube_transforms(capture, "\"fl_x\": 20", [](std::size_t) { return "images/00"; }));
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(std::any_of(dataset->warnings.begin(), dataset->warnings.end(), [](const std::string& w) {
    return w.find("1 of 1 images have 16 bits a channel") != std::string::npos;
  }));
  ImageStore store(*dataset, {});
  REQUIRE(store.get(0).ok());
  CHECK((*store.get(0))->view()(0, 5, 7) == 21);
}
