// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Readers of splat files: what is written is read to within the rounding of its format, and one bit less is not.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "compmark/io/splat/read_splat.hpp"
#include "io/splat_differences.hpp"
#include "io/splat_writers.hpp"

using namespace compmark;

namespace splat_formats_test {

using namespace compmark::testing::splats;

TEST_CASE("io/splat_formats: a 3DGS PLY in any order of its properties, with others among them, every degree") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    const SplatTable table = random_splats(50, degree);
    for (std::uint64_t order = 0; order < 5; ++order) {
      const Result<SplatFile> read = parse_splat(permuted_ply_bytes(table, order), "permuted.ply");
      REQUIRE_MESSAGE(read.ok(), read.error().line());
      CHECK(read->format == SplatFormat::ply);
      const Differences most = differences(table, read->table);
      CHECK(most.mean == 0);
      CHECK(most.log_scale == 0);
      CHECK(most.opacity == 0);
      CHECK(most.harmonics == 0);
      CHECK(most.rotation < 1e-6);
    }
  }
}

TEST_CASE("io/splat_formats: a PLY with red green blue in bytes in place of f_dc, and a trainer's comment") {
  const std::string text =
      "ply\nformat ascii 1.0\ncomment SplatRenderMode: mip\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float opacity\n"
      "property float scale_0\nproperty float scale_1\nproperty float scale_2\nproperty float rot_0\n"
      "property float rot_1\nproperty float rot_2\nproperty float rot_3\nend_header\n1 2 3 255 0 51 0 -1 -2 -3 2 0 0 "
      "0\n";
  const auto check = [](const std::vector<std::byte>& bytes) {
    const Result<SplatFile> read = parse_splat(bytes, "colours.ply");
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    CHECK(color_of_dc(read->table.color(0, 0)[0]) == doctest::Approx(1));
    CHECK(color_of_dc(read->table.color(1, 0)[0]) == doctest::Approx(0));
    CHECK(color_of_dc(read->table.color(2, 0)[0]) == doctest::Approx(0.2));
    CHECK(read->table.rotation[0][0] == 1.0f);  // normalised
    CHECK(read->antialiased);
  };
  const auto bytes_of = [](const std::string& of) { return ByteWriter().put(std::string_view(of)).take(); };
  check(bytes_of(text));
  // Numbers that are no bytes are of no known range.
  for (const char* type : {"float", "ushort"}) {
    CAPTURE(type);
    std::string other = text;
    for (std::size_t at = 0; (at = other.find("uchar")) != std::string::npos;) other.replace(at, 5, type);
    const Result<SplatFile> refused = parse_splat(bytes_of(other), "colours.ply");
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().field == "f_dc_0");
  }
  std::string header = text.substr(0, text.find("end_header\n") + 11);
  header.replace(header.find("ascii"), 5, "binary_little_endian");
  ByteWriter out;
  out.put(std::string_view(header)).put(1.0f).put(2.0f).put(3.0f);
  for (const int color : {255, 0, 51}) out.put(static_cast<std::uint8_t>(color));
  for (const float x : {0.0f, -1.0f, -2.0f, -3.0f, 2.0f, 0.0f, 0.0f, 0.0f}) out.put(x);
  check(out.take());
}

TEST_CASE("io/splat_formats: compressed PLY, to half a step of 11, 10, 8 bits of the ranges of its chunks") {
  for (const int degree : {0, 3}) {
    for (const bool ranges : {false, true}) {
      const SplatTable table = random_splats(600, degree);
      // The widest range that three chunks can have; 10 bits of y are the coarsest. Colours in a chunk's own range.
      Rounding bound;
      bound.mean = 8.0 / 1023 / 2;
      bound.log_scale = 7.0 / 1023 / 2;
      bound.color = (ranges ? 3.2 * sh_constant : 1) / 255 / 2;
      bound.opacity = 1.0 / 255 / 2;
      bound.harmonics = 8.0 / 256 / 2;
      bound.smallest_three = std::sqrt(2.0) / 1023 / 2;
      check_rounding("compressed.ply", table, bound,
                     [&](int drop) { return compressed_ply_bytes(table, ranges, drop); });
    }
  }
  const SplatTable table = random_splats(3, 1);
  CHECK(parse_splat(compressed_ply_bytes(table, true), "x")->format == SplatFormat::compressed_ply);
  // x and z have a bit more than y: their own, narrower bound holds for them and not for y.
  const SplatTable many = random_splats(600, 0);
  const Result<SplatFile> read = parse_splat(compressed_ply_bytes(many, false), "x");
  std::array<double, 3> most{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t row = 0; row < many.count; ++row) {
      most[axis] = std::max(most[axis], std::abs(static_cast<double>(many.mean[axis][row]) -
                                                 static_cast<double>(read->table.mean[axis][row])));
    }
  }
  CHECK(most[0] < 8.0 / 2047 / 2 + float_slack);
  CHECK(most[2] < 8.0 / 2047 / 2 + float_slack);
  CHECK(most[1] > 8.0 / 2047 / 2 + float_slack);
}

TEST_CASE("io/splat_formats: .splat, bytes of colour, opacity and rotation") {
  const SplatTable table = random_splats(500, 0);
  Rounding bound;
  bound.color = bound.opacity = 1.0 / 255 / 2;
  bound.rotation = 2 * std::sqrt(4.0) / 256 / 2 * 1.01;  // four components by 1/256, on a quaternion near norm 1
  check_rounding("scene.splat", table, bound, [&](int drop) { return antimatter_bytes(table, drop); });
}

TEST_CASE("io/splat_formats: .splat is told by its numbers below a limit, and above by the ending of its name") {
  SplatTable table = random_splats(20, 0);
  for (const auto& [place, told] : {std::pair(0.99e9f, true), std::pair(1.01e9f, false)}) {
    table.mean[1][7] = place;
    const std::vector<std::byte> bytes = antimatter_bytes(table, 0);
    CHECK(looks_like_antimatter_splat(bytes) == told);
    const Result<SplatFile> unnamed = parse_splat(bytes, "download");
    CHECK(unnamed.ok() == told);
    const Result<SplatFile> named = parse_splat(bytes, "download.splat");
    REQUIRE_MESSAGE(named.ok(), named.error().line());
    CHECK(named->format == SplatFormat::splat);
    CHECK(named->table.mean[1][7] == place);
  }
  table.mean[1][7] = 0;
  for (const auto& [log_scale, told] : {std::pair(20.7f, true), std::pair(20.8f, false)}) {  // 0.98e9 and 1.08e9
    table.log_scale[2][3] = log_scale;
    CHECK(looks_like_antimatter_splat(antimatter_bytes(table, 0)) == told);
  }
}

TEST_CASE("io/splat_formats: .ksplat of every level and degree") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    const SplatTable table = random_splats(200, degree);
    for (const int level : {0, 1, 2}) {
      Rounding bound;
      bound.color = bound.opacity = 1.0 / 255 / 2;
      if (level > 0) {
        bound.mean = ksplat_block / 2 / 32767 / 2;
        bound.log_scale = std::ldexp(1.0, -11);                  // half a step of a half's mantissa, relative
        bound.rotation = std::ldexp(1.0, -12) * std::sqrt(4.0);  // components below 1
        bound.harmonics = level == 2 ? 2.0 / 255 / 2 : std::ldexp(1.0, -12);
      }
      check_rounding("level " + std::to_string(level) + ".ksplat", table, bound,
                     [&](int drop) { return ksplat_bytes(table, level, drop); });
      CHECK(parse_splat(ksplat_bytes(table, level), "x")->version == level);
    }
  }
}

TEST_CASE("io/splat_formats: SPZ 2 and 3, packed or not, 4 where Zstandard is read") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    const SplatTable table = random_splats(400, degree);
    Rounding bound;
    bound.mean = std::ldexp(1.0, -13);  // 12 bits behind the point
    bound.log_scale = 1.0 / 16 / 2;
    bound.color = sh_constant / (255 * 0.15) / 2;
    bound.opacity = 1.0 / 255 / 2;
    bound.harmonics = 1.0 / 128 / 2;
    bound.smallest_three = std::sqrt(0.5) / 511 / 2;
    check_rounding("v3.spz", table, bound, [&](int drop) { return gzip_bytes(spz_content(table, 3, 12, drop)); });
    check_rounding("raw.spz", table, bound, [&](int drop) { return spz_content(table, 3, 12, drop); });
#if defined(COMPMARK_WITH_ZSTD)
    check_rounding("v4.spz", table, bound, [&](int drop) { return spz4_bytes(table, drop); });
    const Result<SplatFile> read = parse_splat(spz4_bytes(table), "x");
    CHECK(read->version == 4);
    CHECK(read->antialiased);
#endif
    // x y z of version 2 within 1/255 each; w follows from them, so that its error grows where it is small.
    const SplatBytes file = gzip_bytes(spz_content(table, 2));
    const Result<SplatFile> old = parse_splat(file, "v2.spz");
    REQUIRE_MESSAGE(old.ok(), old.error().line());
    CHECK(old->version == 2);
    const Result<SplatFile> coarse = parse_splat(spz_content(table, 2, 12, 1), "v2.spz");
    REQUIRE(coarse.ok());
    const auto most_of_xyz = [&](const SplatTable& other) {
      double most = 0;
      for (std::size_t row = 0; row < table.count; ++row) {
        const std::array<double, 4> p = rotation_of(table, row), q = rotation_of(other, row);
        if (std::abs(p[0]) < 0.2) continue;  // nor are x y z moved by the norm there
        for (std::size_t k = 1; k < 4; ++k) most = std::max(most, std::abs((p[0] < 0 ? -1 : 1) * p[k] - q[k]));
      }
      return most;
    };
    CHECK(most_of_xyz(old->table) <= 1.0 / 255 + float_slack);
    CHECK(most_of_xyz(coarse->table) > 1.0 / 255 + float_slack);
  }
}

TEST_CASE("io/splat_formats: a change of axes moves places, Gaussians and colours alike") {
  const SplatTable table = random_splats(20, 3);
  const auto covariance = [](const SplatTable& of, std::size_t row) {
    const std::array<double, 4> q = rotation_of(of, row);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const std::array<double, 9> r{1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                                  2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                                  2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    std::array<double, 9> c{};
    for (std::size_t i = 0; i < 9; ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        c[i] += r[3 * (i / 3) + k] * r[3 * (i % 3) + k] * std::exp(2 * static_cast<double>(of.log_scale[k][row]));
    }
    return c;
  };
  const auto color = [](const SplatTable& of, std::size_t row, const std::array<double, 3>& direction) {
    double sum = 0;
    for (std::size_t k = 0; k < 16; ++k) sum += sh_basis(direction)[k] * static_cast<double>(of.color(1, k)[row]);
    return sum;
  };
  double unturned = 0;
  for (int bits = 0; bits < 8; ++bits) {
    const detail::AxisSigns signs{(bits & 1) != 0 ? -1 : 1, (bits & 2) != 0 ? -1 : 1, (bits & 4) != 0 ? -1 : 1};
    SplatTable changed = table;
    detail::change_axes(changed, signs);
    for (std::size_t row = 0; row < table.count; ++row) {
      const std::array<double, 9> before = covariance(table, row), after = covariance(changed, row);
      for (std::size_t i = 0; i < 9; ++i)
        CHECK(after[i] == doctest::Approx(before[i] * signs[i / 3] * signs[i % 3]).epsilon(1e-5));
      for (std::size_t axis = 0; axis < 3; ++axis)
        CHECK(changed.mean[axis][row] == static_cast<float>(signs[axis]) * table.mean[axis][row]);
      const std::array<double, 3> d{0.48, -0.6, 0.64};
      const std::array<double, 3> turned{signs[0] * d[0], signs[1] * d[1], signs[2] * d[2]};
      CHECK(color(changed, row, turned) == doctest::Approx(color(table, row, d)).epsilon(1e-6));
      unturned = std::max(unturned, std::abs(color(changed, row, d) - color(table, row, d)));
    }
  }
  CHECK(unturned > 0.5);  // negative control: the law sees signs
}

TEST_CASE("io/splat_formats: an extension says in which frame the places of an SPZ file are") {
#if defined(COMPMARK_WITH_ZSTD)
  const SplatTable table = random_splats(5, 1);
  const auto with = [&](std::uint32_t type, std::uint32_t value) {
    ByteWriter record;
    record.put(std::uint32_t{0x12340001}).put(std::uint32_t{3}).put(std::string_view("abc"));  // of another vendor
    record.put(type).put(std::uint32_t{4}).put(value);
    return parse_splat(spz4_bytes(table, 0, record.take()), "x.spz");
  };
  const Result<SplatFile> rub = with(0xadbe0003, 4), rdf = with(0xadbe0003, 6), none = with(0x12340002, 6);
  REQUIRE(rub.ok());
  REQUIRE(rdf.ok());
  REQUIRE(none.ok());
  CHECK(rub->table.mean == none->table.mean);
  CHECK(rdf->table.mean[0] == rub->table.mean[0]);
  CHECK(rdf->table.mean[1][0] == -rub->table.mean[1][0]);
  CHECK(with(0xadbe0003, 9).error().kind == ErrorKind::unsupported);
  CHECK(with(0xadbe0001, 0).error().kind == ErrorKind::unsupported);
#else
  const SplatTable table = random_splats(5, 1);
  SplatBytes file = spz_content(table, 3);
  file[4] = std::byte{4};
  CHECK_FALSE(parse_splat(file, "x.spz").ok());
#endif
}

}  // namespace splat_formats_test
