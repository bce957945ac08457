// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writers of splat files: what they write is read to within the rounding of the format and not of one bit more, and is
// byte for byte what the tests' own writers make of the same numbers where a format leaves no choice.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "compmark/io/splat/read_splat.hpp"
#include "compmark/io/splat/write_splat.hpp"
#include "compmark/io/zip.hpp"
#include "io/splat_differences.hpp"
#include "io/splat_writers.hpp"

using namespace compmark;

namespace splat_write_test {

using namespace compmark::testing::splats;

SplatBytes encoded(const SplatTable& table, SplatFormat format, const SplatWriteSettings& settings = {}) {
  SerialExecutor executor;
  const Result<EncodedSplats> file =
      detail::encode_splats<nlohmann::ordered_json>(table, format, settings, "test", executor);
  REQUIRE_MESSAGE(file.ok(), file.error().line());
  return file->bytes;
}
std::vector<std::string> notes_of(const SplatTable& table, SplatFormat format,
                                  const SplatWriteSettings& settings = {}) {
  SerialExecutor executor;
  return detail::encode_splats<nlohmann::ordered_json>(table, format, settings, "test", executor)->notes;
}
Error refusal(const SplatTable& table, SplatFormat format, const SplatWriteSettings& settings = {}) {
  SerialExecutor executor;
  const Result<EncodedSplats> file =
      detail::encode_splats<nlohmann::ordered_json>(table, format, settings, "test", executor);
  REQUIRE_FALSE(file.ok());
  CHECK(file.error().file == "test");
  CHECK_FALSE(file.error().remedy.empty());
  return file.error();
}
SplatTable read_back(const SplatBytes& bytes, const std::string& name = "scene") {
  const Result<SplatFile> file = parse_splat(bytes, name);
  REQUIRE_MESSAGE(file.ok(), file.error().line());
  return file->table;
}
/// Rows of a table in another order.
SplatTable rows_in(const SplatTable& table, const std::vector<std::uint32_t>& order) {
  SplatTable moved = table;
  std::vector<std::vector<float>*> columns;
  moved.for_each_column([&](std::vector<float>& column) {
    std::vector<float> sorted;
    for (const std::uint32_t row : order) sorted.push_back(column[row]);
    column = sorted;
  });
  return moved;
}
/// Each bound holds, and half of it does not.
struct Bounds {
  double mean = 0, log_scale = 0, color = 0, opacity = 0, harmonics = 0, smallest_three = 0, rotation = 0;
};
void check_bounds(const SplatTable& table, const SplatTable& read, const Bounds& bound) {
  const Differences found = differences(table, read);
  const auto check = [](const char* what, double is, double most) {
    INFO(what << " " << is << " of " << most);
    CHECK(is <= most + float_slack);
    if (most > 0) CHECK(is > most / 2);  // negative control: a format of one bit more would be nearer
  };
  check("mean", found.mean, bound.mean);
  check("log scale", found.log_scale, bound.log_scale);
  check("colour", found.color, bound.color);
  check("opacity", found.opacity, bound.opacity);
  if (table.degree > 0) check("harmonics", found.harmonics, bound.harmonics);
  if (bound.rotation > 0) {
    check("rotation", found.rotation, bound.rotation);
  } else {
    check("smallest three", found.smallest_three, bound.smallest_three);
  }
}

TEST_CASE("io/splat_write: compressed PLY is byte for byte the tests' own, and finer where near splats lie together") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    CAPTURE(degree);
    const SplatTable table = random_splats(600, degree);
    SplatWriteSettings settings;
    settings.comments = {"of a test"};
    settings.reorder = false;
    const SplatBytes bytes = encoded(table, SplatFormat::compressed_ply, settings);
    const SplatBytes expected = compressed_ply_bytes(table, true);
    REQUIRE(bytes.size() == expected.size());
    std::size_t different = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) different += bytes[i] != expected[i] ? 1u : 0u;
    CHECK(different <= 2);  // a number on a border is rounded by the range as doubles there, as floats here
    CHECK(compressed_ply_bytes(table, true, 1) != bytes);

    Bounds bound;
    bound.mean = 8.0 / 1023 / 2;
    bound.log_scale = 7.0 / 1023 / 2;
    bound.color = 3.2 * sh_constant / 255 / 2;
    bound.opacity = 1.0 / 255 / 2;
    bound.harmonics = 8.0 / 256 / 2;
    bound.smallest_three = std::sqrt(2.0) / 1023 / 2;
    check_bounds(table, read_back(bytes), bound);

    const std::vector<std::uint32_t> order = detail::splat_order(table, true);
    const SplatTable sorted = rows_in(table, order), read = read_back(encoded(table, SplatFormat::compressed_ply));
    CHECK(differences(sorted, read).mean <= bound.mean + float_slack);
    CHECK(differences(sorted, read).harmonics <= bound.harmonics + float_slack);
  }
  // Chunks of near splats have narrower ranges: the mean distance halves.
  const SplatTable many = random_splats(8192, 0);
  const auto distance = [&](bool reorder) {
    SplatWriteSettings settings;
    settings.reorder = reorder;
    const SplatTable sorted = rows_in(many, detail::splat_order(many, reorder)),
                     read = read_back(encoded(many, SplatFormat::compressed_ply, settings));
    double sum = 0;
    for (std::size_t row = 0; row < many.count; ++row)
      sum += std::abs(static_cast<double>(sorted.mean[1][row]) - static_cast<double>(read.mean[1][row]));
    return sum;
  };
  CHECK(distance(true) < 0.55 * distance(false));
  SplatWriteSettings mip;
  mip.antialiased = true;
  CHECK(parse_splat(encoded(random_splats(3, 0), SplatFormat::compressed_ply, mip), "x")->antialiased);
}

TEST_CASE("io/splat_write: .splat is byte for byte the tests' own; what it cannot hold is told") {
  SplatTable table = random_splats(500, 0);
  CHECK(encoded(table, SplatFormat::splat) == antimatter_bytes(table));
  CHECK(encoded(table, SplatFormat::splat) != antimatter_bytes(table, 1));
  CHECK(notes_of(table, SplatFormat::splat).empty());
  table.color(1, 0)[3] = 9;
  const std::vector<std::string> notes = notes_of(table, SplatFormat::splat);
  REQUIRE(notes.size() == 1);
  CHECK(notes[0].find("1 colours lie outside of 0 to 1") != std::string::npos);
  CHECK(notes_of(random_splats(4, 2), SplatFormat::splat).at(0).find("no harmonics") != std::string::npos);
}

TEST_CASE(
    "io/splat_write: SPZ of both versions and every degree, in its own frame, byte for byte before it is packed") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    CAPTURE(degree);
    const SplatTable table = random_splats(400, degree);
    Bounds bound;
    bound.mean = std::ldexp(1.0, -13);
    bound.log_scale = 1.0 / 32;
    bound.color = sh_constant / (255 * 0.15) / 2;
    bound.opacity = 1.0 / 255 / 2;
    bound.harmonics = 1.0 / 256;
    bound.smallest_three = std::sqrt(0.5) / 511 / 2;
    SplatWriteSettings settings;
    settings.spz_version = 3;
    settings.spz_harmonic_bits = {8, 8};
    const SplatBytes packed = encoded(table, SplatFormat::spz, settings);
    const Result<std::vector<std::byte>> content = detail::gunzip(packed, "x");
    REQUIRE(content.ok());
    CHECK(*content == spz_content(table, 3));
    CHECK(*content != spz_content(table, 3, 12, 1));
    check_bounds(table, read_back(packed), bound);
    settings.fractional_bits = 16;
    bound.mean = std::ldexp(1.0, -17);
    check_bounds(table, read_back(encoded(table, SplatFormat::spz, settings)), bound);
    if (degree > 0) {  // as the reference writer has it: 5 and 4 bits
      settings.spz_harmonic_bits = {5, 4};
      bound.harmonics = degree == 1 ? 1.0 / 32 : 1.0 / 16;
      check_bounds(table, read_back(encoded(table, SplatFormat::spz, settings)), bound);
    }
#if defined(COMPMARK_WITH_ZSTD)
    settings.spz_version = 4;
    check_bounds(table, read_back(encoded(table, SplatFormat::spz, settings)), bound);
    settings.spz_version = 0;
    settings.antialiased = true;
    const Result<SplatFile> file = parse_splat(encoded(table, SplatFormat::spz, settings), "x");
    REQUIRE(file.ok());
    CHECK(file->version == 4);
    CHECK(file->antialiased);
#endif
  }
  SplatWriteSettings old;
  old.spz_version = 2;
  CHECK(refusal(random_splats(2, 0), SplatFormat::spz, old).field == "version");
}

TEST_CASE("io/splat_write: SPZ takes the fractional bits that fit, or says that those asked for do not") {
  SplatTable table = random_splats(20, 0);
  const auto bits_of = [&](float farthest) {
    table.mean[0][3] = farthest;
    return spz_bytes_of(table, {}, "x")->fractional_bits.value();
  };
  CHECK(bits_of(2047) == 12);
  CHECK(bits_of(2048) == 11);  // 2^23 steps of 2^-12 are one too many
  CHECK(bits_of(-100000) == 6);
  CHECK(bits_of(8388607) == 0);
  const double read = static_cast<double>(read_back(encoded(table, SplatFormat::spz)).mean[0][3]);
  CHECK(read == 8388607);
  table.mean[0][3] = 8388608;
  const Error far = refusal(table, SplatFormat::spz);
  CHECK(far.field == "positions");
  CHECK(far.problem.find("8388608") != std::string::npos);
  table.mean[0][3] = 3000;
  SplatWriteSettings settings;
  settings.fractional_bits = 12;
  CHECK(refusal(table, SplatFormat::spz, settings).remedy.find("fewer fractional bits") != std::string::npos);
  settings.fractional_bits = 11;
  CHECK(spz_bytes_of(table, settings, "x").ok());
  settings.fractional_bits = 24;
  CHECK(refusal(table, SplatFormat::spz, settings).field == "fractional bits");
  table.log_scale[2][1] = -std::numeric_limits<float>::infinity();
  table.color(0, 0)[2] = 40;
  const std::vector<std::string> notes = notes_of(table, SplatFormat::spz);
  REQUIRE(notes.size() == 2);
  CHECK(notes[0].find("1 log scales lie outside of -10 to 5.94") != std::string::npos);
  CHECK(read_back(encoded(table, SplatFormat::spz)).log_scale[2][1] == -10.0f);
}

TEST_CASE("io/splat_write: SOG, 16 bits of a logarithm for places, 8 for rotations, 256 numbers for the rest") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    CAPTURE(degree);
    const SplatTable table = random_splats(700, degree);
    const SplatBytes bytes = encoded(table, SplatFormat::sog);
    const Result<SplatFile> file = parse_splat(bytes, "scene");
    REQUIRE_MESSAGE(file.ok(), file.error().line());
    CHECK(file->format == SplatFormat::sog);
    CHECK_FALSE(file->antialiased);
    const SplatTable sorted = rows_in(table, detail::splat_order(table, true));
    const Differences found = differences(sorted, file->table);
    // Places in the logarithm, whose steps are even.
    double most = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t row = 0; row < table.count; ++row) {
        const auto logarithm = [](float x) {
          return std::copysign(std::log1p(std::abs(static_cast<double>(x))), static_cast<double>(x));
        };
        most = std::max(most, std::abs(logarithm(sorted.mean[axis][row]) - logarithm(file->table.mean[axis][row])));
      }
    }
    const double range = 2 * std::log(5.0);
    CHECK(most <= range / 65535 / 2 + 2e-7);
    CHECK(most > range / 65535 / 4);
    CHECK(found.smallest_three <= std::sqrt(2.0) / 255 / 2 + float_slack);
    CHECK(found.smallest_three > std::sqrt(2.0) / 255 / 4);
    CHECK(found.opacity <= 1.0 / 255 / 2 + float_slack);
    CHECK(found.opacity > 1.0 / 255 / 4);
    // 256 numbers for evenly spread ones: no worse than twice the half step of an even grid.
    CHECK(found.log_scale < 7.0 / 255);
    CHECK(found.log_scale > 7.0 / 255 / 8);
    CHECK(found.color < 3.2 * sh_constant / 255);
    if (degree > 0) CHECK(found.harmonics < 1.8 / 255);  // every splat has its own set of harmonics here
  }
  SplatWriteSettings mip;
  mip.antialiased = true;
  CHECK(parse_splat(encoded(random_splats(3, 1), SplatFormat::sog, mip), "x")->antialiased);
}

TEST_CASE("io/splat_write: a SOG file has what its specification names, and its indices are the nearest ones") {
  const SplatTable table = random_splats(90, 2);
  SplatWriteSettings settings;
  settings.sog_png = true;
  const SplatBytes bytes = encoded(table, SplatFormat::sog, settings);
  // WebP images hold the same numbers, those of transparent pixels too.
  SplatTable unseen = table;
  unseen.opacity[3] = -std::numeric_limits<float>::infinity();
  const SplatTable png = read_back(encoded(unseen, SplatFormat::sog, settings)),
                   webp = read_back(encoded(unseen, SplatFormat::sog));
  CHECK(png.mean == webp.mean);
  CHECK(png.sh == webp.sh);
  CHECK(png.rotation == webp.rotation);
  CHECK((encoded(table, SplatFormat::sog) != bytes) == has_webp);
  const Result<std::vector<ZipEntry>> entries = parse_zip(bytes, "x", {"a SOG file", "", ""});
  REQUIRE(entries.ok());
  std::vector<std::string> names;
  for (const ZipEntry& entry : *entries) names.push_back(entry.name);
  CHECK(names == std::vector<std::string>{"meta.json", "means_l.png", "means_u.png", "scales.png", "quats.png",
                                          "sh0.png", "shN_centroids.png", "shN_labels.png"});
  const nlohmann::json meta =
      nlohmann::json::parse(reinterpret_cast<const char*>((*entries)[0].content.data()),
                            reinterpret_cast<const char*>((*entries)[0].content.data()) + (*entries)[0].content.size());
  CHECK(meta["version"] == 2);
  CHECK(meta["count"] == 90);
  CHECK(meta["shN"]["bands"] == 2);
  CHECK(meta["shN"]["count"] == 90);
  const std::vector<float> codebook = meta["scales"]["codebook"];
  REQUIRE(codebook.size() == 256);
  const SplatTable read = read_back(bytes), sorted = rows_in(table, detail::splat_order(table, true));
  for (std::size_t row = 0; row < table.count; ++row) {
    const float exact = sorted.log_scale[1][row], found = read.log_scale[1][row];
    for (const float code : codebook) CHECK(std::abs(found - exact) <= std::abs(code - exact));
  }
  const Result<ImageBytes> centroids = decode_image((*entries)[6].content, "x"),
                           quats = decode_image((*entries)[4].content, "x");
  REQUIRE(centroids.ok());
  REQUIRE(quats.ok());
  CHECK(centroids->width == 64 * 8);
  CHECK(centroids->height == 2);
  CHECK(quats->channels == 4);
  CHECK(quats->width * quats->height >= 90);
}

TEST_CASE("io/splat_write: k-means: fewer numbers are worse, a palette of sets is better than one set of them all") {
  const SplatTable table = random_splats(3000, 1);
  std::vector<float> values;
  for (const std::vector<float>& column : table.log_scale) values.insert(values.end(), column.begin(), column.end());
  const auto error_of = [&](std::size_t entries) {
    const std::vector<float> codebook = detail::number_codebook(values, entries);
    CHECK(codebook.size() <= entries);
    CHECK(std::is_sorted(codebook.begin(), codebook.end()));
    double sum = 0;
    for (const float value : values)
      sum += std::pow(static_cast<double>(codebook[detail::nearest_code(codebook, value)] - value), 2);
    return std::sqrt(sum / static_cast<double>(values.size()));
  };
  const double even = 7.0 / 256 / std::sqrt(12.0);  // an even grid over evenly spread numbers
  CHECK(error_of(256) < 1.05 * even);
  CHECK(error_of(128) > 1.5 * even);
  CHECK(error_of(256) < error_of(255) * 1.02);
  CHECK(detail::number_codebook({3, 1, 3, 1}, 256) == std::vector<float>{1, 3});

  SplatWriteSettings settings;
  const auto harmonics_of = [&](std::size_t sets) {
    settings.sog_palette = sets;
    return differences(rows_in(table, detail::splat_order(table, true)),
                       read_back(encoded(table, SplatFormat::sog, settings)))
        .harmonics;
  };
  const double own = harmonics_of(3000), some = harmonics_of(1024), one = harmonics_of(1);
  CHECK(own < 0.01);
  CHECK(some > own);
  CHECK(one > some);
  settings.sog_palette = 65537;
  CHECK(refusal(table, SplatFormat::sog, settings).field == "palette");
  // Two splats of 2,000 that are alike share their set.
  SplatTable alike = table;
  for (std::vector<float>& column : alike.sh) std::fill(column.begin(), column.end(), 0.25f);
  CHECK(differences(rows_in(alike, detail::splat_order(alike, true)), read_back(encoded(alike, SplatFormat::sog, {})))
            .harmonics == 0);
}

TEST_CASE("io/splat_write: .glb holds floats in the frame of glTF: they are read as they were") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    CAPTURE(degree);
    const SplatTable table = random_splats(120, degree);
    const SplatBytes bytes = encoded(table, SplatFormat::glb);
    const Result<SplatFile> file = parse_splat(bytes, "scene");
    REQUIRE_MESSAGE(file.ok(), file.error().line());
    CHECK(file->format == SplatFormat::glb);
    CHECK(bytes.size() % 4 == 0);
    const Differences found = differences(table, file->table);
    CHECK(found.mean == 0);
    CHECK(found.harmonics == 0);
    CHECK(found.color == 0);
    CHECK(found.log_scale < 2e-6);
    CHECK(found.opacity < 1e-6);
    CHECK(found.rotation < 1e-6);
    ByteReader reader(bytes);
    static_cast<void>(reader.take(12));
    const std::uint32_t size = reader.get<std::uint32_t>();
    static_cast<void>(reader.take(4));
    const nlohmann::json gltf = nlohmann::json::parse(reader.text(size));
    const nlohmann::json& primitive = gltf["meshes"][0]["primitives"][0];
    CHECK(primitive["mode"] == 0);
    CHECK(primitive["extensions"]["KHR_gaussian_splatting"]["kernel"] == "ellipse");
    CHECK(gltf["extensionsUsed"][0] == "KHR_gaussian_splatting");
    CHECK(primitive["attributes"].size() == 5 + sh_count(degree));
    CHECK(primitive["attributes"].contains("KHR_gaussian_splatting:SH_DEGREE_3_COEF_6") == (degree == 3));
    // The first place: y and z are turned round.
    static_cast<void>(reader.take(8));
    CHECK(reader.get<float>() == table.mean[0][0]);
    CHECK(reader.get<float>() == -table.mean[1][0]);
    CHECK(reader.get<float>() == -table.mean[2][0]);
    const nlohmann::json& places = gltf["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
    CHECK(places["max"][1].get<float>() == -*std::min_element(table.mean[1].begin(), table.mean[1].end()));
  }
}

TEST_CASE("io/splat_write: lengths beyond a float's are held, and the file is read") {
  for (const SplatFormat format : {SplatFormat::splat, SplatFormat::glb}) {
    CAPTURE(splat_format_name(format));
    SplatTable table = random_splats(5, 0);
    table.log_scale[1][2] = 88.7f;
    table.log_scale[2][4] = -std::numeric_limits<float>::infinity();
    CHECK(notes_of(table, format).empty());
    table.log_scale[0][3] = 88.8f;
    table.log_scale[0][4] = 1e30f;
    const SplatTable read = read_back(encoded(table, format), "scene.splat");
    CHECK(read.log_scale[1][2] == doctest::Approx(88.7).epsilon(1e-6));
    CHECK(read.log_scale[2][4] == -std::numeric_limits<float>::infinity());
    CHECK(read.log_scale[0][3] == doctest::Approx(88.72).epsilon(1e-6));
    CHECK(read.log_scale[0][4] == read.log_scale[0][3]);
    const std::vector<std::string> notes = notes_of(table, format);
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("2 log scales lie outside of -infinity to 88.72") != std::string::npos);
  }
}

TEST_CASE("io/splat_write: glTF's COLOR_0 is linear light, and says nothing to who reads splats") {
  SplatTable table = random_splats(3, 1);
  // Display-referred colours, and what sRGB makes of them (IEC 61966-2-1): 0.5 is 0.21404 of the light.
  table.color(0, 0)[0] = 0;
  table.color(1, 0)[0] = static_cast<float>(0.5 / sh_constant);
  table.color(2, 0)[0] = static_cast<float>(-0.3 / sh_constant);  // a colour of 0.2: 0.033105
  table.color(0, 0)[1] = 30;
  table.color(1, 0)[1] = -30;
  table.opacity[0] = 0;
  SplatBytes bytes = encoded(table, SplatFormat::glb);
  ByteReader reader(bytes);
  static_cast<void>(reader.take(12));
  const std::uint32_t size = reader.get<std::uint32_t>();
  static_cast<void>(reader.take(4));
  const nlohmann::json gltf = nlohmann::json::parse(reader.text(size));
  const std::size_t accessor = gltf["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"];
  const std::size_t view = gltf["accessors"][accessor]["bufferView"];
  const std::size_t at = 12 + 8 + size + 8 + gltf["bufferViews"][view]["byteOffset"].get<std::size_t>();
  const auto byte = [&](std::size_t i) { return std::to_integer<int>(bytes[at + i]); };
  CHECK(byte(0) == 55);
  CHECK(byte(1) == 255);
  CHECK(byte(2) == 8);
  CHECK(byte(3) == 128);  // opacity is linear as it is
  CHECK(byte(4) == 255);
  CHECK(byte(5) == 0);
  const SplatTable read = read_back(bytes);
  for (std::size_t i = 0; i < 12; ++i) bytes[at + i] = std::byte{77};
  CHECK(read_back(bytes).sh == read.sh);
  CHECK(read.sh == table.sh);
}

TEST_CASE("io/splat_write: glTF with colours of another space is refused") {
  const SplatBytes bytes = encoded(random_splats(3, 1), SplatFormat::glb);
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const auto with = [&](const std::string& from, std::string to) {  // of the same length
    std::string other = text;
    to.resize(from.size(), ' ');
    REQUIRE(other.find(from) != std::string::npos);
    other.replace(other.find(from), from.size(), to);
    return parse_splat(ByteWriter().put(std::string_view(other)).take(), "scene.glb");
  };
  CHECK(with("\"srgb_rec709_display\"", "\"srgb_rec709_display\"").ok());
  for (const std::string other : {"\"lin_rec709_display\"", "\"\"", "7", "null"}) {
    CAPTURE(other);
    const Result<SplatFile> read = with("\"srgb_rec709_display\"", other);
    REQUIRE_FALSE(read.ok());
    CHECK(read.error().kind == ErrorKind::unsupported);
    CHECK(read.error().field == "colorSpace");
    CHECK(read.error().remedy.find("display-referred") != std::string::npos);
  }
  CHECK(with("\"colorSpace\"", "\"other\"").error().field == "colorSpace");  // required
}

TEST_CASE("io/splat_write: the same bytes at any number of threads, and no splats or no numbers are refused") {
  const SplatTable table = random_splats(9000, 2);
  SplatWriteSettings settings;
  settings.sog_palette = 512;
  ThreadExecutor two(2);
  const Result<EncodedSplats> file =
      detail::encode_splats<nlohmann::ordered_json>(table, SplatFormat::sog, settings, "x", two);
  REQUIRE(file.ok());
  CHECK(file->bytes == encoded(table, SplatFormat::sog, settings));
  for (const SplatFormat format :
       {SplatFormat::compressed_ply, SplatFormat::splat, SplatFormat::spz, SplatFormat::sog, SplatFormat::glb}) {
    CAPTURE(splat_format_name(format));
    SplatTable none;
    none.resize(0, 1);
    CHECK(refusal(none, format).problem.find("are none") != std::string::npos);
    SplatTable bad = random_splats(9, 1);
    bad.mean[1][7] = std::numeric_limits<float>::quiet_NaN();
    CHECK(refusal(bad, format).line().find("y: is NaN in splat 7") != std::string::npos);
    // One splat, flat and opaque: legal, and nothing has a range.
    SplatTable one = random_splats(1, 3);
    one.log_scale[0][0] = -std::numeric_limits<float>::infinity();
    one.opacity[0] = std::numeric_limits<float>::infinity();
    const SplatTable read = read_back(encoded(one, format));
    REQUIRE(read.count == 1);
    CHECK(std::abs(read.mean[2][0] - one.mean[2][0]) < 2e-4f);
    CHECK(read.log_scale[0][0] <= -10.0f);
    CHECK(read.opacity[0] == doctest::Approx(13.8155).epsilon(1e-3));
  }
  CHECK(refusal(table, SplatFormat::ksplat).problem.find(".ksplat") != std::string::npos);
}

TEST_CASE("io/splat_write: files by the ending of their names, whole or not at all") {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "compmark_splat_write_test";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const SplatTable table = random_splats(50, 1);
  for (const SplatEnding& known : splat_endings) {
    const std::filesystem::path path = folder / ("scene" + std::string(known.ending));
    CAPTURE(path.string());
    const Result<SplatWritten> written = write_splat(path, table);
    REQUIRE_MESSAGE(written.ok(), written.error().line());
    CHECK(written->format == known.format);
    CHECK(written->bytes == std::filesystem::file_size(path));
    const Result<SplatFile> read = read_splat(path);
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    CHECK(read->format == known.format);
    CHECK(read->table.count == 50);
    CHECK(is_splat_file(path));
    CHECK(read->version == (known.format == SplatFormat::splat || written->version == 0 ? 0 : written->version));
  }
  CHECK(splat_format_of_name("A.Compressed.PLY").ok());
  CHECK(*splat_format_of_name("A.Compressed.PLY") == SplatFormat::compressed_ply);
  CHECK(*splat_format_of_name("pipe") == SplatFormat::ply);
  const Result<SplatWritten> other = write_splat(folder / "scene.sogs", table);
  REQUIRE_FALSE(other.ok());
  CHECK(other.error().line().find(".sogs") != std::string::npos);
  SplatWriteSettings named;
  named.format = SplatFormat::sog;
  CHECK(write_splat(folder / "scene.sogs", table, named).ok());
  // The file that was there stays where the new one cannot be written.
  SplatTable bad = table;
  bad.opacity[2] = std::numeric_limits<float>::quiet_NaN();
  CHECK_FALSE(write_splat(folder / "scene.spz", bad).ok());
  CHECK(read_splat(folder / "scene.spz")->table.count == 50);
  CHECK_FALSE(write_splat(folder / "no" / "scene.spz", table).ok());
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    ++files;
    CHECK(entry.path().string().find("partial") == std::string::npos);
  }
  CHECK(files == 7);
  std::filesystem::remove_all(folder);
}

}  // namespace splat_write_test
