// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/splat_ply.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "io/text_of.hpp"

using namespace compmark;
using testing::text_of;

namespace {

std::filesystem::path splat_scratch(const std::string& name) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "compmark_splat_ply_test";
  std::filesystem::create_directories(folder);
  return folder / name;
}

SplatTable random_table(std::size_t rows, int degree) {
  SplatTable table;
  table.resize(rows, degree);
  const Random random(5, 0, random_stage("splat ply test"));
  std::uint64_t index = 0;
  table.for_each_column([&](std::vector<float>& column) {
    for (float& value : column) value = static_cast<float>(random.normal(index++));
  });
  return table;
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::vector<std::vector<float>> columns_of(SplatTable table) {
  std::vector<std::vector<float>> columns;
  table.for_each_column([&](std::vector<float>& column) { columns.push_back(column); });
  return columns;
}

constexpr const char* ascii_body = "0.5 1.5 -2 0.1 0.2 0.3 0.4 -1 -2 -3 1 0 0 0\n";

std::string ascii_file(const std::string& properties, const std::string& body, int rows = 1) {
  std::string header = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(rows) + "\n";
  std::string name;
  for (const char c : properties + " ") {
    if (c != ' ') {
      name += c;
    } else if (!name.empty()) {
      header += "property float " + name + "\n";
      name.clear();
    }
  }
  return header + "end_header\n" + body;
}

}  // namespace

TEST_CASE("io/splat_ply: write then read gives the same bits, for every degree") {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    const SplatTable table = random_table(37, degree);
    const std::filesystem::path path = splat_scratch("round_trip.ply");
    REQUIRE(write_splat_ply(path, table).ok());
    const Result<SplatPly> read = read_splat_ply(path);
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    CHECK(read->table.degree == degree);
    CHECK(read->dropped == 0);
    CHECK(columns_of(read->table) == columns_of(table));
  }
}

TEST_CASE("io/splat_ply: the layout is the published one, byte for byte") {
  const SplatTable table = random_table(2, 3);
  const std::filesystem::path path = splat_scratch("layout.ply");
  REQUIRE(write_splat_ply(path, table).ok());
  const std::string text = text_of(path);
  const std::string header = text.substr(0, text.find("end_header\n") + 11);
  CHECK(header.find(
            "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty "
            "float z\n"
            "property float nx\nproperty float ny\nproperty float nz\nproperty float f_dc_0\nproperty float f_dc_1\n"
            "property float f_dc_2\nproperty float f_rest_0\n") == 0);
  CHECK(header.find("property float f_rest_44\nproperty float opacity\nproperty float scale_0\nproperty float scale_1\n"
                    "property float scale_2\nproperty float rot_0\nproperty float rot_1\nproperty float "
                    "rot_2\nproperty float rot_3\n"
                    "end_header\n") != std::string::npos);
  CHECK(header.find("comment") == std::string::npos);
  REQUIRE(text.size() == header.size() + 2 * 248);  // 62 floats a row (docs/spec/formats.md, 1)
  const auto value = [&](std::size_t row, std::size_t column) {
    float result = 0;
    std::memcpy(&result, text.data() + header.size() + row * 248 + column * 4, 4);
    return result;
  };
  for (std::size_t row = 0; row < 2; ++row) {
    CHECK(value(row, 1) == table.mean[1][row]);
    CHECK(value(row, 4) == 0.0f);
    CHECK(value(row, 7) == table.color(1, 0)[row]);
    // Planar by channel: f_rest index = channel * 15 + (coefficient - 1). Interleaving would put green's first
    // coefficient at 10.
    CHECK(value(row, 9) == table.color(0, 1)[row]);
    CHECK(value(row, 9 + 15) == table.color(1, 1)[row]);
    CHECK(value(row, 9 + 1) == table.color(0, 2)[row]);
    CHECK(value(row, 9 + 1) != table.color(1, 1)[row]);  // negative control
    CHECK(value(row, 54) == table.opacity[row]);
    CHECK(value(row, 55) == table.log_scale[0][row]);
    CHECK(value(row, 58) == table.rotation[0][row]);
  }
}

TEST_CASE("io/splat_ply: reading goes by name: any order, no normals, no f_rest, CRLF, doubles") {
  const std::filesystem::path path = splat_scratch("tolerant.ply");
  write_text(path,
             ascii_file("rot_0 rot_1 rot_2 rot_3 x y z f_dc_0 f_dc_1 f_dc_2 extra opacity scale_2 scale_1 scale_0",
                        "1 0 0 0 5 6 7 .1 .2 .3 99 .4 -3 -2 -1\n"));
  Result<SplatPly> read = read_splat_ply(path);
  REQUIRE_MESSAGE(read.ok(), read.error().line());
  CHECK(read->table.degree == 0);
  CHECK(read->table.mean[2][0] == 7.0f);
  CHECK(read->table.log_scale[0][0] == -1.0f);
  CHECK(read->table.rotation[0][0] == 1.0f);

  std::string crlf;
  for (const char c :
       ascii_file("x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3", ascii_body)) {
    crlf += c == '\n' ? "\r\n" : std::string(1, c);
  }
  crlf.replace(crlf.find("float x"), 7, "double x");
  write_text(path, crlf);
  read = read_splat_ply(path);
  REQUIRE_MESSAGE(read.ok(), read.error().line());
  CHECK(read->table.mean[0][0] == 0.5f);
}

TEST_CASE("io/splat_ply: broken rows are dropped and counted; infinite logits and flat scales are legal") {
  SplatTable table = random_table(6, 1);
  const float infinity = std::numeric_limits<float>::infinity();
  table.opacity[0] = infinity;
  table.log_scale[2][1] = -infinity;
  for (std::vector<float>& column : table.rotation) column[2] = 0;
  table.mean[0][3] = infinity;
  const std::filesystem::path path = splat_scratch("broken.ply");
  REQUIRE(write_splat_ply(path, table).ok());
  const Result<SplatPly> read = read_splat_ply(path);
  REQUIRE(read.ok());
  CHECK(read->dropped == 2);
  CHECK(read->table.count == 4);
  CHECK(read->table.opacity[0] == infinity);
  CHECK(read->table.mean[1][2] == table.mean[1][4]);

  table.color(2, 3)[5] = std::numeric_limits<float>::quiet_NaN();
  const Result<Done> refused = write_splat_ply(path, table);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "f_rest_8");
  CHECK(read_splat_ply(path).ok());  // what was there is untouched
}

TEST_CASE("io/splat_ply: what is not a splat is told by name") {
  struct Case {
    std::string properties, body, field, problem;
    int rows = 1;
  };
  const std::string good = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
  const std::vector<Case> cases{
      {"x y z red", "1 2 3 4\n", "opacity", "point cloud"},
      {"x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 rot_0 rot_1 rot_2 rot_3", "1 2 3 1 1 1 1 1 1 1 0 0 0\n",
       "scale_2", "2D"},
      {"x y z f_anchor_feat_0 opacity", "1 2 3 4 5\n", "f_anchor_feat_0", "anchor table"},
      {"packed_position packed_color", "1 2\n", "packed_position", "SuperSplat"},
      {good + " f_rest_0 f_rest_1", "0 0 0 0 0 0 0 0 0 0 1 0 0 0 1 2\n", "f_rest", "has 2 columns"},
      {"x y f_dc_0 opacity scale_0 rot_0", "0 0 0 0 0 0\n", "z", "missing"},
      {good, "", "vertex", "no rows", 0},
      {good, "1 2 3\n", "", ""},
  };
  const std::filesystem::path path = splat_scratch("wrong.ply");
  for (const Case& one : cases) {
    write_text(path, ascii_file(one.properties, one.body, one.rows));
    const Result<SplatPly> read = read_splat_ply(path);
    REQUIRE_FALSE(read.ok());
    INFO(read.error().line());
    CHECK(read.error().file == path.string());
    if (!one.field.empty()) CHECK(read.error().field == one.field);
    CHECK(read.error().problem.find(one.problem) != std::string::npos);
    CHECK_FALSE(read.error().remedy.empty());
  }
  CHECK(read_splat_ply(splat_scratch("missing.ply")).error().kind == ErrorKind::not_found);
}

TEST_CASE("io/splat_ply: every truncation of a file is an error") {
  const std::filesystem::path whole = splat_scratch("whole.ply"), cut = splat_scratch("cut.ply");
  REQUIRE(write_splat_ply(whole, random_table(3, 0)).ok());
  const std::string text = text_of(whole);
  for (std::size_t size = 0; size < text.size(); size += size < 20 ? 1 : 7) {
    write_text(cut, text.substr(0, size));
    CHECK_FALSE(read_splat_ply(cut).ok());
  }
}
