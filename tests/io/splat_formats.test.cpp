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
#include <vector>

#include "compmark/io/splat/read_splat.hpp"
#include "io/splat_writers.hpp"

using namespace compmark;

namespace splat_formats_test {

using namespace compmark::testing::splats;

/// Largest differences of two tables, each in the units that its bound is stated in.
struct Differences {
  double mean = 0, log_scale = 0, color = 0, opacity = 0, harmonics = 0;  ///< colour and opacity in [0, 1]
  double smallest_three = 0;  ///< of a rotation's components beside the largest
  double rotation = 0;        ///< |q - r| or |q + r|, the smaller
};
Differences differences(const SplatTable& a, const SplatTable& b) {
  REQUIRE(a.count == b.count);
  REQUIRE(a.degree == b.degree);
  Differences most;
  const auto raise = [](double& value, double to) { value = std::max(value, std::abs(to)); };
  for (std::size_t row = 0; row < a.count; ++row) {
    const auto d = [row](const std::vector<float>& x, const std::vector<float>& y) {
      return static_cast<double>(x[row]) - static_cast<double>(y[row]);
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      raise(most.mean, d(a.mean[axis], b.mean[axis]));
      raise(most.log_scale, d(a.log_scale[axis], b.log_scale[axis]));
      raise(most.color, color_of_dc(a.color(axis, 0)[row]) - color_of_dc(b.color(axis, 0)[row]));
      for (std::size_t k = 1; k < a.coefficients(); ++k) raise(most.harmonics, d(a.color(axis, k), b.color(axis, k)));
    }
    raise(most.opacity, sigmoid(a.opacity[row]) - sigmoid(b.opacity[row]));
    const std::array<double, 4> p = rotation_of(a, row), q = rotation_of(b, row);
    double plus = 0, minus = 0, norm = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      plus += (p[k] + q[k]) * (p[k] + q[k]);
      minus += (p[k] - q[k]) * (p[k] - q[k]);
      norm += q[k] * q[k];
    }
    CHECK(std::abs(norm - 1) < 1e-6);
    raise(most.rotation, std::sqrt(std::min(plus, minus)));
    const SmallestThree three = smallest_three(p);
    for (std::size_t k = 0, n = 0; k < 4; ++k) {
      if (k != three.largest)
        raise(most.smallest_three,
              three.others[n++] - (plus < minus ? -1 : 1) * (p[three.largest] < 0 ? -1 : 1) * q[k]);
    }
  }
  return most;
}

/// Bounds from the bits of a format; 0: not rounded beyond a float's own, 1e-6 relative here.
struct Rounding {
  double mean = 0, log_scale = 0, color = 0, opacity = 0, harmonics = 0, smallest_three = 0, rotation = 0;
};
constexpr double float_slack = 2e-6;  // of numbers up to 8, or of their logarithms

/// All are within the bounds; and of a file with one bit less, every rounded quantity beyond its own.
template <class Write>
void check_rounding(const std::string& name, const SplatTable& table, const Rounding& bound, const Write& write) {
  INFO(name);
  const Result<SplatFile> read = parse_splat(write(0), name);
  REQUIRE_MESSAGE(read.ok(), read.error().line());
  const Result<SplatFile> coarse = parse_splat(write(1), name);
  REQUIRE_MESSAGE(coarse.ok(), coarse.error().line());
  const Differences fine = differences(table, read->table), less = differences(table, coarse->table);
  const auto check = [&](const char* what, double bound_of, double found, double found_coarse) {
    INFO(what << ": " << found << " and with a bit less " << found_coarse << ", bound " << bound_of);
    CHECK(found <= bound_of + float_slack);
    if (bound_of > 0) CHECK(found_coarse > bound_of + float_slack);  // negative control
  };
  check("mean", bound.mean, fine.mean, less.mean);
  check("log scale", bound.log_scale, fine.log_scale, less.log_scale);
  check("colour", bound.color, fine.color, less.color);
  check("opacity", bound.opacity, fine.opacity, less.opacity);
  if (table.degree > 0) check("harmonics", bound.harmonics, fine.harmonics, less.harmonics);
  if (bound.rotation > 0) {
    check("rotation", bound.rotation, fine.rotation, less.rotation);
  } else {
    check("smallest three", bound.smallest_three, fine.smallest_three, less.smallest_three);
  }
}

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
  const auto bytes_of = [](const std::string& of) { return ByteWriter().put(std::string_view(of)).take(); };
  const Result<SplatFile> refused = parse_splat(bytes_of(text), "colours.ply");
  // An ASCII file does not say how its numbers were rounded: bytes are taken from binary files alone.
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "f_dc_0");
  std::string header = text.substr(0, text.find("end_header\n") + 11);
  header.replace(header.find("ascii"), 5, "binary_little_endian");
  ByteWriter out;
  out.put(std::string_view(header)).put(1.0f).put(2.0f).put(3.0f);
  for (const int color : {255, 0, 51}) out.put(static_cast<std::uint8_t>(color));
  for (const float x : {0.0f, -1.0f, -2.0f, -3.0f, 2.0f, 0.0f, 0.0f, 0.0f}) out.put(x);
  const Result<SplatFile> read = parse_splat(out.take(), "colours.ply");
  REQUIRE_MESSAGE(read.ok(), read.error().line());
  CHECK(color_of_dc(read->table.color(0, 0)[0]) == doctest::Approx(1));
  CHECK(color_of_dc(read->table.color(2, 0)[0]) == doctest::Approx(0.2));
  CHECK(read->table.rotation[0][0] == 1.0f);  // normalised
  CHECK(read->antialiased);
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
