// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What small files promise: the smallest file of an image is read, a smaller one that promises as much is refused
// before memory is taken.
#include "compmark/io/image_limit.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "compmark/io/image_file.hpp"
#include "compmark/scene/mask_file.hpp"
#include "support/scene_files.hpp"
#include "support/short_training.hpp"

namespace {

using namespace compmark;
using testing::TemporaryFolder;

using Data = std::vector<std::byte>;

void put_number(Data& data, std::uint32_t value, int bytes) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8)
    data.push_back(static_cast<std::byte>(value >> shift & 255u));
}

/// A stream of deflate, bit by bit.
class Deflate {
 public:
  Data bytes;
  void bits(unsigned value, int count) {
    for (int i = 0; i < count; ++i) {
      if (used_ % 8 == 0) bytes.push_back(std::byte{0});
      bytes.back() |= static_cast<std::byte>((value >> i & 1u) << used_ % 8);
      ++used_;
    }
  }

 private:
  std::size_t used_ = 0;
};

/// `count` zeros as deflate says it in the fewest bits: copies of 258 bytes, each a code of one bit for the length and
/// one for the distance.
Data packed_zeros(std::size_t count) {
  Deflate out;
  out.bits(0x78, 8);
  out.bits(0x01, 8);
  out.bits(1, 1);  // the last block
  out.bits(2, 2);  // with codes of its own
  out.bits(29, 5);
  out.bits(0, 5);
  out.bits(14, 4);  // 18 lengths of the code of lengths, in the format's order: 18, 0, 1 and 2 have two bits
  for (const int symbol : {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1})
    out.bits(symbol == 18 || symbol <= 2 ? 2 : 0, 3);
  // Two bits each, in the order of the symbols: 0 -> 00, 1 -> 01, 2 -> 10, 18 -> 11; codes go in from their highest
  // bit.
  const auto length = [&](int symbol) {
    constexpr unsigned codes[] = {0, 2, 1};  // reversed
    out.bits(codes[symbol], 2);
  };
  const auto zeros = [&](unsigned n) {  // 11 to 138
    out.bits(3, 2);
    out.bits(n - 11, 7);
  };
  length(2);  // the byte 0
  zeros(138);
  zeros(117);
  length(2);  // the end
  zeros(28);
  length(1);                                     // 258 bytes once more
  length(1);                                     // from one byte before
  const auto literal = [&] { out.bits(1, 2); };  // 10, reversed
  literal();
  for (count -= 1; count >= 258; count -= 258) out.bits(0, 2);
  for (; count > 0; --count) literal();
  out.bits(3, 2);  // the end
  for (int i = 0; i < 4; ++i) out.bits(0, 8);
  return out.bytes;
}

/// The smallest PNG of so many black pixels; the header may say another height.
Data black_png(std::uint32_t width, std::uint32_t height, int depth, int type, std::uint32_t said_height) {
  Data file;
  const auto chunk = [&](const char* name, const Data& data) {
    put_number(file, static_cast<std::uint32_t>(data.size()), 4);
    for (int i = 0; i < 4; ++i) file.push_back(static_cast<std::byte>(name[i]));
    file.insert(file.end(), data.begin(), data.end());
    put_number(file, 0, 4);
  };
  put_number(file, 0x89504E47u, 4);
  put_number(file, 0x0D0A1A0Au, 4);
  Data header;
  put_number(header, width, 4);
  put_number(header, said_height, 4);
  put_number(header, static_cast<std::uint32_t>(depth), 1);
  put_number(header, static_cast<std::uint32_t>(type), 1);
  put_number(header, 0, 3);
  chunk("IHDR", header);
  const std::size_t samples = type == 2 ? 3 : type == 4 ? 2 : type == 6 ? 4 : 1;
  chunk("IDAT", packed_zeros(height * (1 + (width * samples * static_cast<std::size_t>(depth) + 7) / 8)));
  chunk("IEND", {});
  return file;
}

/// A progressive JPEG of one grey component, one bit a block; `interval`: units between restarts, of which `restarts`
/// are there.
Data flat_jpeg(unsigned side, unsigned interval, unsigned restarts, bool with_scan = true) {
  Data file;
  put_number(file, 0xFFD8, 2);
  put_number(file, 0xFFDB, 2);
  put_number(file, 67, 2);
  put_number(file, 0, 1);
  for (int i = 0; i < 64; ++i) put_number(file, 1, 1);
  put_number(file, 0xFFC2, 2);
  put_number(file, 11, 2);
  put_number(file, 8, 1);
  put_number(file, side, 2);
  put_number(file, side, 2);
  for (const std::uint32_t value : {1u, 1u, 0x11u, 0u}) put_number(file, value, 1);
  put_number(file, 0xFFC4, 2);
  put_number(file, 2 + 17 + 1, 2);
  for (int i = 0; i < 17; ++i) put_number(file, i == 1 ? 1 : 0, 1);
  put_number(file, 0, 1);
  put_number(file, 0xFFDD, 2);
  put_number(file, 4, 2);
  put_number(file, interval, 2);
  if (with_scan) {
    put_number(file, 0xFFDA, 2);
    put_number(file, 8, 2);
    for (const std::uint32_t value : {1u, 1u, 0u, 0u, 0u, 0u}) put_number(file, value, 1);
    const unsigned units = side / 8 * (side / 8), each = interval == 0 ? units : interval;
    for (unsigned k = 0, done = 0; done < units && k <= restarts; ++k, done += each) {
      if (k != 0) put_number(file, 0xFFD0 + (k - 1) % 8, 2);
      const unsigned now = std::min(each, units - done);
      file.insert(file.end(), (now + 7) / 8, std::byte{0});
    }
  }
  put_number(file, 0xFFD9, 2);
  return file;
}

/// A JPEG without all of its segments of a kind; those that it has lie before the first scan.
Data without_segments(const Data& file, unsigned marker) {
  Data result(file.begin(), file.begin() + 2);
  std::size_t i = 2;
  while (file[i + 1] != std::byte{0xDA}) {
    const std::size_t size =
        2 + 256 * std::to_integer<std::size_t>(file[i + 2]) + std::to_integer<std::size_t>(file[i + 3]);
    const auto begin = file.begin() + static_cast<std::ptrdiff_t>(i);
    if (file[i + 1] != static_cast<std::byte>(marker))
      result.insert(result.end(), begin, begin + static_cast<std::ptrdiff_t>(size));
    i += size;
  }
  result.insert(result.end(), file.begin() + static_cast<std::ptrdiff_t>(i), file.end());
  return result;
}

TEST_CASE(
    "io/image_limit: the smallest files of an image are read, 1032 bytes of rows a byte; of twice the height they "
    "promise too much") {
  for (const auto& form : {std::pair{1, 0}, {8, 0}, {8, 2}, {16, 6}, {8, 4}}) {
    const int depth = form.first, type = form.second;
    CAPTURE(depth);
    CAPTURE(type);
    const std::uint32_t width = depth == 1 ? 8000 : 1000, height = 2400;
    const Data good = black_png(width, height, depth, type, height);
    const std::uint64_t rows = std::uint64_t{width} * height * detail::png_pixel_bits(good) / 8;
    CHECK(static_cast<double>(rows) > 900.0 * static_cast<double>(good.size()));
    const auto image = decode_image(good, "good");
    REQUIRE_MESSAGE(image.ok(), (image.ok() ? "" : image.error().line()));
    CHECK(image->width == static_cast<int>(width));
    CHECK(std::count(image->pixels.begin(), image->pixels.end(), 0) ==
          static_cast<std::ptrdiff_t>(image->pixels.size()));
    const auto twice = decode_image(black_png(width, height, depth, type, 2 * height), "twice");
    REQUIRE(!twice.ok());
    CHECK(twice.error().kind == ErrorKind::truncated);
    CHECK(testing::names(twice.error(), "twice", "", "copy it again"));
    CHECK(twice.error().problem.find(std::to_string(width) + " x " + std::to_string(2 * height)) != std::string::npos);
  }
}

TEST_CASE("io/image_limit: a file of 187 kB that promises gigabytes is refused, and takes none of them") {
  Data bomb = black_png(16000, 12000, 8, 0, 16000);
  for (const int type : {6, 2}) {  // RGBA, RGB
    bomb[25] = static_cast<std::byte>(type);
    CHECK(bomb.size() > 150'000);
    CHECK(bomb.size() < 200'000);
    const std::size_t before = testing::peak_memory();
    const auto image = decode_image(bomb, "bomb");
    REQUIRE(!image.ok());
    CHECK(image.error().kind == ErrorKind::truncated);
    CHECK(testing::peak_memory() < before + (std::size_t{8} << 20));
  }
  // As a mask, in all of its bits.
  const TemporaryFolder folder;
  bomb[24] = std::byte{16};
  bomb[25] = std::byte{0};
  bomb[22] = std::byte{0xF0};  // 61440 rows
  REQUIRE(write_file(folder.path() / "mask.png", std::span<const std::byte>(bomb)).ok());
  const auto mask = read_mask_file(folder.path() / "mask.png");
  REQUIRE(!mask.ok());
  CHECK(!mask.error().remedy.empty());
}

TEST_CASE("io/image_limit: a PNG whose chunk says that it has a gigabyte is damaged, and takes none") {
  Data file = black_png(1000, 800, 8, 0, 800);
  file[33] = std::byte{0x3F};  // of the length of IDAT
  const std::size_t before = testing::peak_memory();
  const auto image = decode_image(file, "chunk");
  REQUIRE(!image.ok());
  CHECK(image.error().problem.find("longer than the file") != std::string::npos);
  CHECK(testing::peak_memory() < before + (std::size_t{8} << 20));
}

TEST_CASE("io/image_limit: a pixel beyond its palette is black, not what lay in memory") {
  const auto palette_picture = [](std::size_t colours) {
    Data file;
    const auto chunk = [&](const char* name, std::span<const std::byte> data) {
      put_number(file, static_cast<std::uint32_t>(data.size()), 4);
      for (int i = 0; i < 4; ++i) file.push_back(static_cast<std::byte>(name[i]));
      file.insert(file.end(), data.begin(), data.end());
      put_number(file, 0, 4);
    };
    put_number(file, 0x89504E47u, 4);
    put_number(file, 0x0D0A1A0Au, 4);
    Data header;
    for (const std::uint32_t side : {4u, 1u}) put_number(header, side, 4);
    put_number(header, 0x08030000u, 4);
    put_number(header, 0, 1);
    chunk("IHDR", header);
    chunk("PLTE", Data(3 * colours, std::byte{200}));
    std::vector<unsigned char> row{0, 0, 1, 2, 255};
    int size = 0;
    unsigned char* const packed = detail::stb::stbi_zlib_compress(row.data(), static_cast<int>(row.size()), &size, 8);
    chunk("IDAT", std::as_bytes(std::span<const unsigned char>(packed, static_cast<std::size_t>(size))));
    std::free(packed);
    chunk("IEND", {});
    const auto image = decode_image(file, "palette");
    REQUIRE_MESSAGE(image.ok(), (image.ok() ? "" : image.error().line()));
    return image->pixels;
  };
  CHECK(palette_picture(256) == std::vector<std::uint8_t>(12, 200));
  CHECK(palette_picture(3) == std::vector<std::uint8_t>{200, 200, 200, 200, 200, 200, 200, 200, 200, 0, 0, 0});
  CHECK(palette_picture(1) == std::vector<std::uint8_t>{200, 200, 200, 0, 0, 0, 0, 0, 0, 0, 0, 0});
}

TEST_CASE("io/image_limit: who says how much memory there is gets an error or an image within it") {
  const Data file = black_png(2000, 2000, 8, 2, 2000);
  const std::uint64_t needed = detail::decoding_bytes(file, 2000 * 2000, 3, 8);
  CHECK(needed > std::uint64_t{3} * 2000 * 2000 * 3);
  const auto refused = decode_image(file, "large", needed - 1);
  REQUIRE(!refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK(testing::names(refused.error(), "large", "", "scale it down"));
  const std::size_t before = testing::peak_memory();
  CHECK(decode_image(file, "large", needed).ok());
  const std::uint64_t shadow = testing::short_trainings ? needed / 8 : 0;  // of an address sanitizer
  CHECK(testing::peak_memory() <= before + needed + shadow + (std::size_t{4} << 20));
}

TEST_CASE(
    "io/image_limit: a Huffman table of too many codes is found before the size is looked for, wherever it is cut") {
  // stb_image writes past its tables there already.
  Data file{std::byte{0xFF}, std::byte{0xD8}};
  put_number(file, 0xFFC4, 2);
  put_number(file, 2 + 17, 2);
  put_number(file, 0, 1);
  for (int i = 0; i < 16; ++i) put_number(file, 255, 1);
  const Data flat = flat_jpeg(64, 0, 0);
  file.insert(file.end(), flat.begin() + 2, flat.end());
  for (std::size_t n = 9; n <= file.size(); ++n) {
    CAPTURE(n);
    const auto info = decode_image_info(std::span<const std::byte>(file).first(n), "table");
    REQUIRE(!info.ok());
    CHECK(info.error().problem.find("Huffman") != std::string::npos);
  }
  file.insert(file.begin(), std::byte{0xFF});  // a fill byte
  CHECK(decode_image(file, "filled").error().problem.find("Huffman") != std::string::npos);
}

TEST_CASE(
    "io/image_limit: a JPEG of one bit a block is read; one without its data, or that ends at a restart, is damaged") {
  const Data flat = flat_jpeg(1024, 0, 0);
  CHECK(flat.size() < 1024 * 1024 / 450);
  const auto image = decode_image(flat, "flat");
  REQUIRE_MESSAGE(image.ok(), (image.ok() ? "" : image.error().line()));
  CHECK(image->pixels == std::vector<std::uint8_t>(1024 * 1024, 128));

  CHECK(decode_image(flat_jpeg(64, 16, 3), "restarts").ok());
  for (unsigned restarts = 0; restarts < 3; ++restarts) {
    const auto early = decode_image(flat_jpeg(64, 16, restarts), "early");
    REQUIRE(!early.ok());
    CHECK(early.error().problem.find("end early") != std::string::npos);
  }
  const auto empty = decode_image(flat_jpeg(64, 0, 0, false), "empty");
  REQUIRE(!empty.ok());
  CHECK(empty.error().problem.find("without data") != std::string::npos);
  for (const bool baseline : {false, true}) {
    Data whole = flat;
    ImageBytes grey{16, 16, 3, std::vector<std::uint8_t>(16 * 16 * 3, 77)};
    if (baseline) whole = encode_jpeg(grey, 90);
    REQUIRE(decode_image(whole, "whole").ok());
    for (const unsigned marker : {0xC4u, 0xDBu}) {  // tables that are not there are not those of another file
      const auto lacks = decode_image(without_segments(whole, marker), "lacks");
      REQUIRE(!lacks.ok());
      CHECK(lacks.error().problem.find("table that is missing") != std::string::npos);
    }
  }
  const auto promise = decode_image(flat_jpeg(4096, 0, 0, false), "promise");
  REQUIRE(!promise.ok());
  CHECK(promise.error().kind == ErrorKind::truncated);
}

}  // namespace
