// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/app/picture.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/io/image_file.hpp"
#include "support/tool.hpp"

using namespace compmark;

TEST_CASE("app/picture: a file and the same pixels in memory are one picture, opaque on the colour behind it") {
  const testing::ScratchFolder folder("compmark-picture");
  ImageBytes image;
  image.width = 40;
  image.height = 30;
  image.channels = 4;
  image.pixels.resize(std::size_t{40} * 30 * 4);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<std::uint8_t>((i * 37) % 251);
  image.pixels[3] = 0;  // the first pixel is not there
  const auto path = folder.path / "picture.png";
  REQUIRE(write_png(path, image).ok());

  PictureSettings settings;
  settings.background = {1, 0, 0.5f};
  const Result<OpenPicture> file = open_picture(path, settings);
  const Result<OpenPicture> given = open_picture(GivenPicture{"given", 40, 30, 4, image.pixels}, settings);
  REQUIRE(file.ok());
  REQUIRE(given.ok());
  CHECK(file->planes == given->planes);
  CHECK(file->image().width == 40);
  CHECK(file->image().height == 30);
  CHECK(file->planes[0] == 1);
  CHECK(file->planes[1200] == 0);
  CHECK(file->planes[2400] == doctest::Approx(0.5).epsilon(0.01));
  CHECK_FALSE(file->part);
  CHECK(file->sha256 != given->sha256);  // of a file, and of pixels

  settings.mirrored = true;
  const Result<OpenPicture> mirrored = open_picture(path, settings);
  REQUIRE(mirrored.ok());
  CHECK(mirrored->planes[39] == file->planes[0]);
  CHECK(mirrored->planes[40] == file->planes[79]);

  const OpenPicture part = part_of(*file, {2, 3, 5, 7});
  CHECK(part.image().size() == 3 * 5 * 7);
  CHECK(part.planes[0] == file->planes[2 * 40 + 3]);
  CHECK(part.planes.back() == file->planes[2400 + 6 * 40 + 9]);
}

TEST_CASE(
    "app/picture: a picture that is none, or too large for the memory that may be taken, is refused by its name") {
  std::vector<std::uint8_t> pixels(std::size_t{30} * 40 * 3);
  for (const GivenPicture& wrong :
       {GivenPicture{"wrong", 40, 31, 3, pixels}, GivenPicture{"wrong", -40, -30, 3, pixels},
        GivenPicture{"wrong", 40, 30, 5, pixels}, GivenPicture{"wrong", 0, 30, 3, pixels}}) {
    const Result<OpenPicture> refused = open_picture(wrong);
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().file == "wrong");
    CHECK(refused.error().kind == ErrorKind::invalid);
  }
  PictureSettings small;
  small.memory_budget_mb = 1;
  std::vector<std::uint8_t> large(std::size_t{200} * 200 * 3);
  const Result<OpenPicture> refused = open_picture(GivenPicture{"large", 200, 200, 3, large}, small);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().file == "large");
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK_FALSE(open_picture("no_such_file.png").ok());
}
