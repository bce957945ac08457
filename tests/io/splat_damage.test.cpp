// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Readers of splat files with damaged, foreign and lying files: an error in words, or a table that can be used.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "compmark/io/splat/read_splat.hpp"
#include "io/splat_writers.hpp"

using namespace compmark;

namespace splat_damage_test {

using namespace compmark::testing::splats;

struct SmallFile {
  std::string name;
  SplatBytes bytes;
};
std::vector<SmallFile> small_files() {
  const SplatTable flat = random_splats(4, 0), round = random_splats(2, 3);
  std::vector<SmallFile> files{
      {"plain.ply", permuted_ply_bytes(round, 1)},      {"compressed.ply", compressed_ply_bytes(round, true)},
      {"small.splat", antimatter_bytes(flat)},          {"floats.ksplat", ksplat_bytes(flat, 0)},
      {"bytes.ksplat", ksplat_bytes(round, 2)},         {"gzip.spz", gzip_bytes(spz_content(round, 3))},
      {"second.spz", gzip_bytes(spz_content(flat, 2))}, {"raw.spz", spz_content(round, 3)}};
#if defined(COMPMARK_WITH_ZSTD)
  files.push_back({"fourth.spz", spz4_bytes(round)});
#endif
  return files;
}

/// 1 where it is refused, in words; 0 where it is read, whole and usable.
int refused(const SplatBytes& bytes, const std::string& name) {
  const Result<SplatFile> file = parse_splat(bytes, name);
  if (!file) {
    const bool words = !file.error().problem.empty() && !file.error().remedy.empty() && file.error().file == name;
    if (!words) FAIL_CHECK(name << ": an error without words: " << file.error().line());
    return 1;
  }
  bool whole = file->table.count > 0;
  detail::for_each_splat_column(file->table, [&](const std::string& column, const std::vector<float>& values) {
    whole = whole && values.size() == file->table.count;
    for (const float value : values) {
      whole =
          whole && !std::isnan(value) && (std::isfinite(value) || column == "opacity" || column.starts_with("scale"));
    }
  });
  if (!whole) FAIL_CHECK(name << ": a table that cannot be used");
  return 0;
}

void expect_error(const SplatBytes& bytes, const std::string& name, ErrorKind kind, const std::string& words) {
  const Result<SplatFile> file = parse_splat(bytes, name);
  REQUIRE_FALSE(file.ok());
  INFO(file.error().line());
  CHECK(file.error().kind == kind);
  CHECK(file.error().line().find(words) != std::string::npos);
}

void put_number(SplatBytes& bytes, std::size_t at, std::uint64_t value, std::size_t width) {
  for (std::size_t i = 0; i < width; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i) & 255);
}
SplatBytes text_bytes(const std::string& text) { return ByteWriter().put(std::string_view(text)).take(); }

TEST_CASE("io/splat_damage: every truncation of a small file is refused; of a .splat all but those between splats") {
  for (const SmallFile& file : small_files()) {
    const std::string& name = file.name;
    const SplatBytes& bytes = file.bytes;
    std::size_t read = 0;
    REQUIRE(refused(bytes, name) == 0);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const SplatBytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
      read += refused(cut, name) == 0 ? 1u : 0u;
    }
    INFO(name);
    CHECK(read == (name == "small.splat" ? 3 : 0));
    SplatBytes longer = bytes;
    longer.push_back(std::byte{1});
    // Bytes behind the last row of a PLY, or behind the last section, are nobody's.
    CHECK(refused(longer, name) == (name.ends_with("ply") || name.ends_with("ksplat") ? 0 : 1));
  }
}

TEST_CASE("io/splat_damage: every single bit of a small file: refused, or read as something usable") {
  for (const SmallFile& file : small_files()) {
    const std::string& name = file.name;
    const SplatBytes& bytes = file.bytes;
    std::size_t refusals = 0;
    SplatBytes changed = bytes;
    for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
      changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
      refusals += static_cast<std::size_t>(refused(changed, name));
      changed[bit / 8] = bytes[bit / 8];
    }
    MESSAGE(name << ": " << refusals << " of " << 8 * bytes.size() << " bits refused");
    // A checksum sees all but the bits of gzip that mean nothing: time, level, system, "text", those behind the stream.
    if (name == "gzip.spz" || name == "second.spz") CHECK(8 * bytes.size() - refusals <= 8 * 6 + 1 + 7);
  }
}

TEST_CASE("io/splat_damage: counts that the bytes do not hold are refused before memory is taken") {
  const SplatTable table = random_splats(4, 3);
  SplatBytes spz = spz_content(table, 3);
  for (const std::uint64_t count : {5ull, 1ull << 28, 0xffffffffull}) {
    put_number(spz, 8, count, 4);
    expect_error(spz, "raw.spz", ErrorKind::truncated, "points");
    expect_error(gzip_bytes(spz), "gzip.spz", ErrorKind::truncated, "points");
  }
  put_number(spz, 8, 0, 4);
  expect_error(spz, "raw.spz", ErrorKind::invalid, "none");

  SplatBytes zip = gzip_bytes(spz_content(table, 3));
  put_number(zip, zip.size() - 4, 0x7fffffff, 4);
  expect_error(zip, "size.spz", ErrorKind::malformed, "which it cannot");
  put_number(zip, zip.size() - 4, 20, 4);  // less than it holds: the output is not let grow
  expect_error(zip, "size.spz", ErrorKind::malformed, "damaged");

  for (const std::size_t at : {4u, 16u, 4096u, 4100u, 4108u, 4132u}) {
    SplatBytes ksplat = ksplat_bytes(table, 1);
    put_number(ksplat, at, 0xffffffff, 4);
    INFO(at);
    CHECK(refused(ksplat, "lies.ksplat") == 1);
  }
  for (const char* count : {"18446744073709551615", "4294967296", "5"}) {
    const std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::string(count) +
                               "\nproperty float x\nend_header\n";
    expect_error(text_bytes(header + "1234"), "lies.ply", ErrorKind::truncated, "vertex");
  }
  SplatBytes ply = compressed_ply_bytes(random_splats(2, 0), false);
  std::string text(reinterpret_cast<const char*>(ply.data()), ply.size());
  text.replace(text.find("chunk 1"), 7, "chunk 9");
  CHECK(refused(text_bytes(text), "lies.ply") == 1);

#if defined(COMPMARK_WITH_ZSTD)
  SplatBytes fourth = spz4_bytes(table);
  const std::uint64_t count = 1u << 28;
  put_number(fourth, 8, count, 4);
  expect_error(fourth, "fourth.spz", ErrorKind::malformed, "has not the size of the points");
  const std::array<std::uint64_t, 6> of_splat{9, 1, 3, 3, 4, 45};
  for (std::size_t i = 0; i < 6; ++i) put_number(fourth, 32 + 16 * i + 8, of_splat[i] * count, 8);
  expect_error(fourth, "fourth.spz", ErrorKind::exhausted, "more than");
  put_number(fourth, 32, std::numeric_limits<std::uint64_t>::max(), 8);
  expect_error(fourth, "fourth.spz", ErrorKind::truncated, "longer than the file");
#endif
}

TEST_CASE("io/splat_damage: a number that no renderer can use is refused with its column and its splat") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  const auto with = [&](auto change) {
    SplatTable table = random_splats(9, 1);
    change(table);
    return permuted_ply_bytes(table, 2);
  };
  expect_error(with([&](SplatTable& t) { t.mean[1][7] = nan; }), "a.ply", ErrorKind::invalid, "y: is NaN in splat 7");
  expect_error(with([&](SplatTable& t) { t.mean[2][0] = -infinity; }), "a.ply", ErrorKind::invalid,
               "z: is infinite in splat 0");
  expect_error(with([&](SplatTable& t) { t.color(2, 3)[8] = infinity; }), "a.ply", ErrorKind::invalid,
               "f_rest_8: is infinite in splat 8");
  expect_error(with([&](SplatTable& t) { t.log_scale[0][3] = infinity; }), "a.ply", ErrorKind::invalid, "scale_0");
  expect_error(with([&](SplatTable& t) { t.opacity[3] = nan; }), "a.ply", ErrorKind::invalid, "opacity");
  expect_error(with([&](SplatTable& t) {
                 for (std::vector<float>& column : t.rotation) column[5] = 0;
               }),
               "a.ply", ErrorKind::invalid, "the rotation of splat 5 is zero");
  // Flat and opaque splats are legal: trainers write them.
  CHECK(refused(with([&](SplatTable& t) { t.log_scale[0][3] = -infinity; }), "a.ply") == 0);
  CHECK(refused(with([&](SplatTable& t) { t.opacity[3] = infinity; }), "a.ply") == 0);

  SplatBytes splat = antimatter_bytes(random_splats(3, 0));
  put_number(splat, 32 + 12, 0xbf800000, 4);  // a length of -1
  expect_error(splat, "a.splat", ErrorKind::invalid, "scale_0: is NaN in splat 1");
  put_number(splat, 32 + 12, 0, 4);
  CHECK(refused(splat, "a.splat") == 0);
  put_number(splat, 32, 0x7f800000, 4);
  expect_error(splat, "a.splat", ErrorKind::invalid, "x: is infinite in splat 1");
}

TEST_CASE("io/splat_damage: the content says what a file is, not its name") {
  for (const SmallFile& file : small_files()) {
    const std::string& name = file.name;
    const SplatBytes& bytes = file.bytes;
    for (const char* other : {"a.ply", "a.spz", "a", "a.ksplat"}) {
      INFO(name << " as " << other);
      const Result<SplatFile> right = parse_splat(bytes, name), read = parse_splat(bytes, other);
      REQUIRE(right.ok());
      // A .splat has no sign of its own, so that the name of a .ksplat is believed.
      if (name == "small.splat" && std::string(other) == "a.ksplat") continue;
      REQUIRE_MESSAGE(read.ok(), read.error().line());
      CHECK(read->format == right->format);
    }
  }
  const std::string formats = "read are 3DGS PLY";
  expect_error(text_bytes("some notes about splats\n"), "notes.txt", ErrorKind::malformed, formats);
  expect_error(text_bytes("\x89PNG\r\n\x1a\n and so on"), "a.splat", ErrorKind::malformed, "is a PNG image");
  SplatBytes unknown(64, std::byte{0xfe});
  expect_error(unknown, "unknown.bin", ErrorKind::malformed, formats);
  expect_error({}, "empty.spz", ErrorKind::malformed, "is an empty file");
  expect_error(gzip_bytes(text_bytes("a text")), "text.gz", ErrorKind::malformed, "does not begin with NGSP");
  expect_error(text_bytes("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
                          "z\nend_header\n1 2 3\n"),
               "points.ply", ErrorKind::malformed, "point cloud");
}

TEST_CASE("io/splat_damage: files on disk") {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "compmark_splat_damage_test";
  std::filesystem::create_directories(folder);
  for (const SmallFile& file : small_files()) {
    const std::string& name = file.name;
    const SplatBytes& bytes = file.bytes;
    std::ofstream(folder / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    const Result<SplatFile> read = read_splat(folder / name), parsed = parse_splat(bytes, name);
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    CHECK(is_splat_file(folder / name));
    CHECK(read->table.mean == parsed->table.mean);
    CHECK(read->table.sh == parsed->table.sh);
  }
  std::ofstream(folder / "notes.txt") << "notes\n";
  CHECK_FALSE(is_splat_file(folder / "notes.txt"));
  CHECK(read_splat(folder / "notes.txt").error().file == (folder / "notes.txt").string());
  CHECK_FALSE(is_splat_file(folder / "missing.ply"));
  CHECK(read_splat(folder / "missing.ply").error().kind == ErrorKind::not_found);
  CHECK(read_splat(folder).error().kind == ErrorKind::unreadable);
  std::filesystem::remove_all(folder);
}

}  // namespace splat_damage_test
