// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/anchor_ply.hpp"

#include <doctest/doctest.h>

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

std::filesystem::path anchor_scratch(const std::string& name) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "compmark_anchor_ply_test";
  std::filesystem::create_directories(folder);
  return folder / name;
}

AnchorPly random_anchors(std::size_t rows, std::size_t offsets, std::size_t feature_dim) {
  AnchorPly anchors;
  anchors.rows = rows;
  anchors.offsets = offsets;
  anchors.feature_dim = feature_dim;
  const Random random(6, 0, random_stage("anchor ply test"));
  std::uint64_t index = 0;
  const auto fill = [&](std::vector<float>& values, std::size_t count) {
    values.resize(count);
    for (float& value : values) value = static_cast<float>(random.normal(index++));
  };
  fill(anchors.position, rows * 3);
  fill(anchors.offset, rows * 3 * offsets);
  fill(anchors.scaling, rows * 6);
  fill(anchors.feature, rows * feature_dim);
  return anchors;
}

}  // namespace

TEST_CASE("io/anchor_ply: write then read gives the same bits, for several K and D") {
  for (const auto& [offsets, feature_dim] : {std::pair<std::size_t, std::size_t>{10, 32}, {5, 50}, {1, 1}}) {
    const AnchorPly anchors = random_anchors(23, offsets, feature_dim);
    const std::filesystem::path path = anchor_scratch("round_trip.ply");
    REQUIRE(write_anchor_ply(path, anchors.columns()).ok());
    const Result<AnchorPly> read = read_anchor_ply(path);
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    CHECK(read->rows == 23);
    CHECK(read->offsets == offsets);
    CHECK(read->feature_dim == feature_dim);
    CHECK(read->position == anchors.position);
    CHECK(read->offset == anchors.offset);
    CHECK(read->scaling == anchors.scaling);
    CHECK(read->feature == anchors.feature);
  }
}

TEST_CASE("io/anchor_ply: the published layout: 97 floats at D = 50, K = 10, offsets axis-major") {
  const AnchorPly anchors = random_anchors(2, 10, 50);
  const std::filesystem::path path = anchor_scratch("layout.ply");
  REQUIRE(write_anchor_ply(path, anchors.columns()).ok());
  const std::string text = text_of(path);
  const std::size_t start = text.find("end_header\n") + 11;
  REQUIRE(text.size() == start + 2 * 388);  // docs/spec/formats.md, 2
  const auto value = [&](std::size_t row, std::size_t column) {
    float result = 0;
    std::memcpy(&result, text.data() + start + row * 388 + column * 4, 4);
    return result;
  };
  const AnchorColumns<const float> columns = anchors.columns();
  for (std::size_t row = 0; row < 2; ++row) {
    CHECK(value(row, 2) == columns.position(row, 2));
    CHECK(value(row, 3) == 0.0f);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t k = 0; k < 10; ++k) CHECK(value(row, 6 + axis * 10 + k) == columns.offset(row, 3 * k + axis));
    }
    CHECK(value(row, 7) != columns.offset(row, 1));  // negative control: the table's own order
    CHECK(value(row, 36) == columns.feature(row, 0));
    CHECK(value(row, 86) == doctest::Approx(-2.1972));
    CHECK(value(row, 87) == columns.scaling(row, 0));
    CHECK(value(row, 93) == 1.0f);
    CHECK(value(row, 94) == 0.0f);
  }
}

TEST_CASE("io/anchor_ply: bad files are told by field") {
  const std::filesystem::path path = anchor_scratch("wrong.ply");
  const auto write_text = [&](const std::string& text) { std::ofstream(path, std::ios::binary) << text; };
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
  write_text(head + "property float opacity\nend_header\n1 2 3 4\n");
  CHECK(read_anchor_ply(path).error().field == "f_offset_0");
  write_text(head + "property float f_offset_0\nproperty float f_anchor_feat_0\nend_header\n1 2 3 4 5\n");
  CHECK(read_anchor_ply(path).error().field == "f_offset");
  write_text(head +
             "property float f_offset_0\nproperty float f_offset_1\nproperty float f_offset_2\nproperty float "
             "f_anchor_feat_0\n"
             "end_header\n1 2 3 4 5 6 7\n");
  CHECK(read_anchor_ply(path).error().field == "scale_0");

  AnchorPly anchors = random_anchors(4, 2, 3);
  anchors.feature[3 * 2 + 1] = std::numeric_limits<float>::quiet_NaN();
  REQUIRE(write_anchor_ply(path, anchors.columns()).ok());
  const Result<AnchorPly> read = read_anchor_ply(path);
  REQUIRE_FALSE(read.ok());
  CHECK(read.error().line().find("f_anchor_feat_1: row 2 is not finite") != std::string::npos);
}
