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
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/io/splat/read_splat.hpp"
#include "compmark/io/splat/write_splat.hpp"
#include "compmark/io/zip_writer.hpp"
#include "io/splat_writers.hpp"

using namespace compmark;

namespace splat_damage_test {

using namespace compmark::testing::splats;

struct SmallFile {
  std::string name;
  SplatBytes bytes;
};
/// Formats that the tests have no writer of their own for.
SplatBytes written_bytes(const SplatTable& table, SplatFormat format) {
  SerialExecutor executor;
  SplatWriteSettings settings;
  settings.sog_png = true;
  const Result<EncodedSplats> file =
      detail::encode_splats<nlohmann::ordered_json>(table, format, settings, "small", executor);
  REQUIRE(file.ok());
  return file->bytes;
}

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
  files.push_back({"small.sog", written_bytes(round, SplatFormat::sog)});
  files.push_back({"small.glb", written_bytes(random_splats(2, 1), SplatFormat::glb)});
  return files;
}

/// Every byte and bit of most files is tried; of those with JSON, which take milliseconds each without an optimiser, one
/// of some.
std::size_t stride_of(const std::string& name) { return name.ends_with("sog") ? 211 : name.ends_with("glb") ? 13 : 1; }

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
    for (std::size_t size = 0; size < bytes.size(); size += stride_of(name)) {
      const SplatBytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
      read += refused(cut, name) == 0 ? 1u : 0u;
    }
    INFO(name);
    CHECK(read == (name == "small.splat" ? 3 : 0));
    SplatBytes longer = bytes;
    longer.push_back(std::byte{1});
    // Bytes behind the last row of a PLY, the last section, or an archive's directory, are nobody's.
    const bool ends_before = name.ends_with("ply") || name.ends_with("ksplat") || name.ends_with("sog");
    CHECK(refused(longer, name) == (ends_before ? 0 : 1));
  }
}

TEST_CASE("io/splat_damage: every single bit of a small file: refused, or read as something usable") {
  for (const SmallFile& file : small_files()) {
    const std::string& name = file.name;
    const SplatBytes& bytes = file.bytes;
    std::size_t refusals = 0;
    SplatBytes changed = bytes;
    for (std::size_t bit = 0; bit < 8 * bytes.size(); bit += stride_of(name)) {
      changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
      refusals += static_cast<std::size_t>(refused(changed, name));
      changed[bit / 8] = bytes[bit / 8];
    }
    MESSAGE(name << ": " << refusals << " of " << 8 * bytes.size() / stride_of(name) << " bits refused");
    // A checksum sees all but the bits of gzip that mean nothing: time, level, system, "text", those behind the stream.
    if (name == "gzip.spz" || name == "second.spz") CHECK(8 * bytes.size() - refusals <= 8 * 6 + 1 + 7);
    // So it does in an archive, but in headers of which the directory says all that is read: dates, sizes, attributes.
    if (name == "small.sog") CHECK(refusals > 9 * (8 * bytes.size() / stride_of(name)) / 10);
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

/// A SOG file of 3 splats with one entry or one field of meta.json replaced.
SplatBytes changed_sog(const std::string& entry, const SplatBytes* content,
                       const std::function<void(nlohmann::json&)>& change = {}) {
  const SplatBytes file = written_bytes(random_splats(3, 1), SplatFormat::sog);
  std::vector<ZipEntry> entries = *parse_zip(file, "x", {"a SOG file", "", ""});
  std::string text(reinterpret_cast<const char*>(entries[0].content.data()), entries[0].content.size());
  if (change) {
    nlohmann::json meta = nlohmann::json::parse(text);
    change(meta);
    text = meta.dump();
  }
  entries[0].content = std::as_bytes(std::span<const char>(text));
  std::vector<ZipEntry> kept;
  for (const ZipEntry& found : entries) {
    if (found.name != entry) kept.push_back(found);
    if (found.name == entry && content != nullptr) kept.push_back({entry, *content});
  }
  return *zip_bytes(kept);
}
SplatBytes png_of(int width, int height, int channels, std::uint8_t value) {
  const std::size_t size = static_cast<std::size_t>(width * height * channels);
  return encode_png({width, height, channels, std::vector<std::uint8_t>(size, value)});
}

TEST_CASE("io/splat_damage: SOG files that lie about counts, images and tables") {
  const auto with = [](const std::function<void(nlohmann::json&)>& change) { return changed_sog("", nullptr, change); };
  CHECK(refused(with([](nlohmann::json&) {}), "a.sog") == 0);
  const auto expect = [](const SplatBytes& bytes, ErrorKind kind, const std::string& words) {
    expect_error(bytes, "a.sog", kind, words);
  };
  expect(with([](nlohmann::json& m) { m["version"] = 3; }), ErrorKind::unsupported, "version: is 3");
  expect(with([](nlohmann::json& m) { m.erase("version"); }), ErrorKind::unsupported, "version 1");
  expect(with([](nlohmann::json& m) { m["count"] = 0; }), ErrorKind::invalid, "holds no splat");
  expect(with([](nlohmann::json& m) { m["count"] = 17; }), ErrorKind::truncated, "4 pixels");
  expect(with([](nlohmann::json& m) { m["count"] = 1u << 30; }), ErrorKind::exhausted, "bytes can hold");
  expect(with([](nlohmann::json& m) { m["count"] = std::numeric_limits<std::uint64_t>::max(); }), ErrorKind::exhausted,
         "bytes can hold");
  expect(with([](nlohmann::json& m) { m["count"] = -3; }), ErrorKind::malformed, "count");
  expect(with([](nlohmann::json& m) { m["means"]["mins"] = {0, 1}; }), ErrorKind::malformed, "means.mins");
  expect(with([](nlohmann::json& m) { m["means"]["maxs"][1] = nullptr; }), ErrorKind::malformed, "means.maxs");
  expect(with([](nlohmann::json& m) { m["means"]["maxs"][1] = 1e4; }), ErrorKind::invalid, "is infinite");
  expect(with([](nlohmann::json& m) { m["means"]["files"] = {"means_l.png"}; }), ErrorKind::malformed, "means.files");
  expect(with([](nlohmann::json& m) { m["means"]["files"][1] = "../means_u.png"; }), ErrorKind::malformed,
         "not in the archive");
  expect(with([](nlohmann::json& m) { m["scales"]["codebook"] = {1}; }), ErrorKind::invalid, "has no number");
  expect(with([](nlohmann::json& m) { m["scales"]["codebook"] = nlohmann::json::array(); }), ErrorKind::malformed,
         "scales.codebook");
  expect(with([](nlohmann::json& m) { m["sh0"] = 7; }), ErrorKind::malformed, "sh0.files");
  expect(with([](nlohmann::json& m) { m.erase("quats"); }), ErrorKind::malformed, "quats.files");
  expect(with([](nlohmann::json& m) { m["shN"]["bands"] = 4; }), ErrorKind::invalid, "shN.bands");
  expect(with([](nlohmann::json& m) { m["shN"]["bands"] = 2; }), ErrorKind::malformed, "192 x 1 pixels");
  expect(with([](nlohmann::json& m) { m["shN"]["count"] = 65; }), ErrorKind::malformed, "shN.count");
  expect(with([](nlohmann::json& m) { m["shN"]["count"] = 1; }), ErrorKind::invalid, "has no set");
  expect(with([](nlohmann::json& m) { m["shN"] = nullptr; }), ErrorKind::malformed, "bands");

  const SplatBytes none, text = text_bytes("{"), webp = text_bytes(std::string("RIFF\x10\0\0\0WEBPVP8L", 16));
  expect(changed_sog("meta.json", nullptr), ErrorKind::malformed, "meta.json");
  expect(changed_sog("meta.json", &text), ErrorKind::malformed, "not valid JSON");
  expect(changed_sog("scales.png", &none), ErrorKind::truncated, "scales.files");
  expect(changed_sog("scales.png", &webp), has_webp ? ErrorKind::malformed : ErrorKind::unsupported, "WebP");
#if defined(COMPMARK_WITH_WEBP)
  // A WebP image of many pixels is some bytes: its size is compared with the splats before memory is taken.
  const SplatBytes small = detail::encode_webp({4, 1, 3, std::vector<std::uint8_t>(12)}),
                   large = detail::encode_webp({2048, 1024, 3, std::vector<std::uint8_t>(std::size_t{3} << 21)});
  CHECK(large.size() < 10000);
  CHECK(refused(changed_sog("scales.png", &small), "a.sog") == 0);
  expect(changed_sog("scales.png", &large), ErrorKind::exhausted, "2048 x 1024 pixels");
  for (std::size_t size = 0; size < small.size(); ++size) {
    const SplatBytes cut(small.begin(), small.begin() + static_cast<std::ptrdiff_t>(size));
    CHECK(refused(changed_sog("scales.png", &cut), "a.sog") == 1);
  }
#endif
  const SplatBytes wide = png_of(8, 1, 3, 0), thin = png_of(4, 1, 3, 0), modes = png_of(4, 1, 4, 0),
                   huge = png_of(8, 8, 3, 0);
  expect(changed_sog("means_u.png", &wide), ErrorKind::malformed, "another size");
  expect(changed_sog("quats.png", &thin), ErrorKind::malformed, "3 channels, expected 4");
  expect(changed_sog("quats.png", &modes), ErrorKind::invalid, "no largest component");
  expect(changed_sog("shN_centroids.png", &huge), ErrorKind::malformed, "shN.count");
  SplatBytes damaged = thin;
  damaged[damaged.size() / 2] ^= std::byte{0x40};
  CHECK(refused(changed_sog("scales.png", &damaged), "a.sog") == 1);
  // An archive of something else is no splat file, whatever it holds.
  const SplatBytes photo = *zip_bytes(std::vector<ZipEntry>{{"photo.png", thin}});
  expect_error(photo, "photos.zip", ErrorKind::malformed, "ZIP archive");
  expect_error(photo, "photos.sog", ErrorKind::malformed, "meta.json");
}

TEST_CASE("io/splat_damage: .glb files that lie about counts and places, and those of other things") {
  const auto with = [](const std::function<void(nlohmann::json&)>& change) {
    const SplatBytes file = written_bytes(random_splats(3, 1), SplatFormat::glb);
    ByteReader reader(file);
    static_cast<void>(reader.take(12));
    const std::uint32_t size = reader.get<std::uint32_t>();
    static_cast<void>(reader.take(4));
    nlohmann::json gltf = nlohmann::json::parse(reader.text(size));
    const std::span<const std::byte> rest = reader.take(reader.left());
    change(gltf);
    const std::string text = gltf.dump();
    ByteWriter out;
    out.put(std::string_view("glTF")).put(std::uint32_t{2});
    out.put(static_cast<std::uint32_t>(20 + text.size() + rest.size())).put(static_cast<std::uint32_t>(text.size()));
    out.put(std::string_view("JSON")).put(std::string_view(text)).put(rest);
    return out.take();
  };
  const auto expect = [&](const std::function<void(nlohmann::json&)>& change, ErrorKind kind,
                          const std::string& words) { expect_error(with(change), "a.glb", kind, words); };
  const auto primitive = [](nlohmann::json& g) -> nlohmann::json& { return g["meshes"][0]["primitives"][0]; };
  CHECK(refused(with([](nlohmann::json&) {}), "a.glb") == 0);
  for (const std::uint64_t count : {std::uint64_t{4}, std::uint64_t{1} << 40, ~std::uint64_t{0}})
    expect([&](nlohmann::json& g) { g["accessors"][0]["count"] = count; }, ErrorKind::truncated, "POSITION");
  expect([](nlohmann::json& g) { g["accessors"][0]["count"] = 0; }, ErrorKind::invalid, "has no splats");
  expect([](nlohmann::json& g) { g["accessors"][2]["count"] = 2; }, ErrorKind::malformed, "another count");
  expect([](nlohmann::json& g) { g["accessors"][0]["type"] = "VEC4"; }, ErrorKind::malformed, "VEC3");
  expect([](nlohmann::json& g) { g["accessors"][0]["componentType"] = 5125; }, ErrorKind::unsupported, "5125");
  expect([](nlohmann::json& g) { g["accessors"][0]["bufferView"] = 99; }, ErrorKind::malformed, "buffer view");
  expect([](nlohmann::json& g) { g["accessors"][0]["byteOffset"] = 1000; }, ErrorKind::truncated, "outside");
  expect([](nlohmann::json& g) { g["accessors"][0]["sparse"] = {{"count", 1}}; }, ErrorKind::unsupported, "sparse");
  expect([](nlohmann::json& g) { g["bufferViews"][0]["byteOffset"] = ~std::uint64_t{0}; }, ErrorKind::truncated,
         "outside");
  expect([](nlohmann::json& g) { g["bufferViews"][0]["byteLength"] = 1u << 20; }, ErrorKind::truncated, "outside");
  expect([](nlohmann::json& g) { g["bufferViews"][0]["byteStride"] = 4; }, ErrorKind::malformed, "stride");
  expect([](nlohmann::json& g) { g["bufferViews"][0]["buffer"] = 1; }, ErrorKind::truncated, "outside");
  expect([](nlohmann::json& g) { g["nodes"][0]["rotation"] = {1, 0, 0, 0}; }, ErrorKind::unsupported, "moves");
  expect([&](nlohmann::json& g) { primitive(g)["attributes"].erase("KHR_gaussian_splatting:SCALE"); },
         ErrorKind::malformed, "SCALE");
  expect([&](nlohmann::json& g) { primitive(g)["extensions"]["KHR_gaussian_splatting"]["kernel"] = "box"; },
         ErrorKind::unsupported, "ellipse");
  expect(
      [&](nlohmann::json& g) {
        primitive(g)["extensions"]["KHR_gaussian_splatting"]["extensions"] = {{"some_compression", {{"a", 1}}}};
      },
      ErrorKind::unsupported, "change what the numbers mean");
  expect([&](nlohmann::json& g) { primitive(g).erase("extensions"); }, ErrorKind::unsupported, "no splats");
  expect([&](nlohmann::json& g) { g["meshes"].push_back(nlohmann::json(g["meshes"][0])); }, ErrorKind::unsupported,
         "several");
  // Interleaved and shared places are legal: a stride that fits is followed.
  const SplatBytes apart = with([](nlohmann::json& g) {
    g["bufferViews"][0]["byteStride"] = 12;
    g["bufferViews"][0]["byteLength"] = 36;
  });
  CHECK(refused(apart, "a.glb") == 0);
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
