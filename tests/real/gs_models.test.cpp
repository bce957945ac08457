// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Splat files that other tools wrote (data/gs_models): the reader takes them, and writing them again keeps every
// number.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "compmark/io/splat/read_splat.hpp"
#include "compmark/io/splat_ply.hpp"
#include "support/data.hpp"

using namespace compmark;

TEST_CASE("real/gs_models: splat files of other tools are read, with an extra property too, and survive a round trip") {
  const std::optional<std::filesystem::path> data = testing::data_dir();
  if (!data) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  struct Sample {
    const char* name;
    std::size_t count;
    bool rest_is_zero;
  };
  for (const Sample& sample : {Sample{"fruit_drops_minimal.ply", 4721, false},
                               Sample{"lod1_tile_0_0.5x.ply", 14051, true}, Sample{"lod3_tile_0.ply", 1971, true}}) {
    INFO(sample.name);
    Result<SplatPly> read = read_splat_ply(*data / "gs_models" / sample.name);
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    SplatTable& table = read->table;
    CHECK(table.count + read->dropped == sample.count);
    CHECK(read->dropped == 0);
    CHECK(table.degree == 3);
    if (sample.rest_is_zero) {  // data/README: lod1 has all f_rest = 0
      double sum = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = 1; i < 16; ++i) {
          for (const float value : table.color(c, i)) sum += static_cast<double>(std::abs(value));
        }
      }
      if (std::string(sample.name) == "lod1_tile_0_0.5x.ply") CHECK(sum == 0);
    }
    // Plausible splats: opacities use the range, scales are logs of lengths within the cloud's extent.
    float extent = 0, largest = -100;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto [low, high] = std::minmax_element(table.mean[axis].begin(), table.mean[axis].end());
      extent = std::max(extent, *high - *low);
      largest = std::max(largest, *std::max_element(table.log_scale[axis].begin(), table.log_scale[axis].end()));
    }
    CHECK(extent > 0);
    CHECK(std::exp(largest) < extent);

    const std::filesystem::path copy = std::filesystem::temp_directory_path() / "compmark_gs_models_test.ply";
    REQUIRE(write_splat_ply(copy, table).ok());
    Result<SplatPly> again = read_splat_ply(copy);
    REQUIRE(again.ok());
    std::vector<std::vector<float>> first, second;
    table.for_each_column([&](std::vector<float>& column) { first.push_back(column); });
    again->table.for_each_column([&](std::vector<float>& column) { second.push_back(column); });
    CHECK(first == second);
    std::filesystem::remove(copy);
  }
}

TEST_CASE("real/gs_models: one scene of four splats in every format of other tools is the same scene") {
  const std::optional<std::filesystem::path> data = testing::data_dir();
  if (!data) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  const std::filesystem::path folder = *data / "gs_models";
  const Result<SplatFile> plain = read_splat(folder / "minimal.splat");
  REQUIRE_MESSAGE(plain.ok(), plain.error().line());
  CHECK(plain->format == SplatFormat::splat);
  REQUIRE(plain->table.count == 4);
  struct Sample {
    const char* name;
    SplatFormat format;
    int version;
  };
  for (const Sample& sample :
       {Sample{"minimal.ksplat", SplatFormat::ksplat, 0}, Sample{"minimal-v3.spz", SplatFormat::spz, 3},
        Sample{"minimal-v4.spz", SplatFormat::spz, 4}}) {
    INFO(sample.name);
    const Result<SplatFile> read = read_splat(folder / sample.name);
    if (sample.version == 4 && !reads_zstd) {
      REQUIRE_FALSE(read.ok());
      CHECK(read.error().kind == ErrorKind::unsupported);
      continue;
    }
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    CHECK(read->format == sample.format);
    CHECK(read->version == sample.version);
    const SplatTable &a = plain->table, &b = read->table;
    REQUIRE(b.count == 4);
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {  // whole numbers: exact, and in one frame
        CHECK(a.mean[axis][i] == b.mean[axis][i]);
        CHECK(std::abs(a.log_scale[axis][i] - b.log_scale[axis][i]) < 1.0f / 16);
        CHECK(std::abs(a.color(axis, 0)[i] - b.color(axis, 0)[i]) < 1 / (255 * 0.15f));
      }
      CHECK(a.opacity[i] == doctest::Approx(b.opacity[i]));
    }
  }
  // Version 2, as it is and in gzip, by another tool: the same grid of places.
  const Result<SplatFile> raw = read_splat(folder / "minimal-raw.spz"), packed = read_splat(folder / "minimal-v2.spz");
  REQUIRE_MESSAGE(raw.ok(), raw.error().line());
  REQUIRE_MESSAGE(packed.ok(), packed.error().line());
  CHECK(raw->version == 2);
  CHECK(raw->table.mean == packed->table.mean);
  CHECK(raw->table.sh == packed->table.sh);
  for (std::size_t i = 0; i < 4; ++i) CHECK(raw->table.mean[0][i] == plain->table.mean[0][i]);
  for (const char* name : {"fruit_drops_minimal.ply", "lod1_tile_0_0.5x.ply", "lod3_tile_0.ply"}) {
    const Result<SplatFile> read = read_splat(folder / name);
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    CHECK(read->format == SplatFormat::ply);
  }
  CHECK_FALSE(read_splat(folder / "LICENSE.supersplat").ok());
}
