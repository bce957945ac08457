// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "support/cmk_file.hpp"
#include "support/codec_model.hpp"

namespace {

using namespace compmark;
using testing::decoded;
using testing::encoded;
using testing::make_codec_model;
using testing::same;

TEST_CASE("hac/hac: a file decodes to the encoder's own quantised model, to the last bit") {
  const CodecModel model = make_codec_model(1);
  const CodecEncoded file = encoded(model);
  const CodecDecoded back = decoded(file.bytes);
  CHECK(back.verified);
  CHECK(back.damaged.empty());
  CHECK(same(back.model, file.model));
  CHECK(file.report.anchors + file.report.dropped == model.anchors());
  CHECK(file.report.dropped > 0);
  CHECK(file.report.clamped == std::array<std::uint64_t, 3>{});
  // Every coded value is within half a step of what it was; the step is at most 2 Q0.
  const VoxelRange range = voxel_range(back.model.voxels);
  std::vector<std::uint32_t> unmasked;
  std::vector<Voxel> unmasked_voxels;
  for (std::uint32_t i = 0; i < model.anchors(); ++i) {
    if (model.mask[i] == 0) continue;
    unmasked.push_back(i);
    unmasked_voxels.push_back(model.voxels[i]);
  }
  const std::vector<std::uint32_t> order = morton_order(unmasked_voxels, range);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::size_t row = unmasked[order[i]];
    REQUIRE(back.model.voxels[i] == model.voxels[row]);
    REQUIRE(back.model.mask[i] == model.mask[row]);
    for (std::size_t c = 0; c < 6; ++c) {
      REQUIRE(std::abs(back.model.feature[6 * i + c] - model.feature[6 * row + c]) <= 1.0f);
      REQUIRE(std::abs(back.model.scale[6 * i + c] - model.scale[6 * row + c]) <= 0.001f);
    }
    for (std::size_t c = 0; c < 9; ++c) {
      if ((model.mask[row] >> (c / 3) & 1u) == 0) {
        REQUIRE(back.model.offset[9 * i + c] == 0);
      } else {
        REQUIRE(std::abs(back.model.offset[9 * i + c] - model.offset[9 * row + c]) <= 0.2f);
      }
    }
  }
}

TEST_CASE("hac/hac: encoding what was decoded gives the same bytes") {
  for (const std::uint64_t seed : {2u, 3u, 4u})
    testing::check_round_trip(make_codec_model(seed, {.anchors = 150 * seed}));
}

TEST_CASE("hac/hac: bytes and model are the same at any number of threads") {
  testing::check_any_threads(make_codec_model(5, {.anchors = 700}));
}

TEST_CASE("hac/hac: the file is as large as its tables say, and the report counts every byte") {
  const CodecEncoded file = encoded(make_codec_model(6, testing::full_codec_model(1200)));
  const CodecReport& report = file.report;
  std::uint64_t sum = report.container_bytes + report.extra_bytes;
  for (const auto& [kind, bytes] : report.section_bytes) sum += bytes;
  CHECK(sum == report.total_bytes);
  CHECK(report.total_bytes == file.bytes.size());
  CHECK(report.bytes_of(HacFormat::stream) <
        report.total_bytes * 8 / 10);  // negative control (ME4): what is often given for the size
  CHECK(std::abs(report.estimated_bytes() / static_cast<double>(report.total_bytes) - 1) < 0.0005);
  MESSAGE("1200 anchors: ", report.total_bytes, " bytes; GEOM ", report.bytes_of(HacFormat::geometry), ", MASK ",
          report.bytes_of(HacFormat::mask), ", HASH ", report.bytes_of(HacFormat::hash), ", NETC ",
          report.bytes_of(HacFormat::context), ", STRM ", report.bytes_of(HacFormat::stream), "; the tables say ",
          report.estimated_bytes());
}

TEST_CASE(
    "hac/hac: the bits that are found for the context's weights make a smaller file than any common number, and the "
    "same steps") {
  SerialExecutor executor;
  const CodecModel model = make_codec_model(14, {.anchors = 900, .feature_dim = 12, .hidden = 40});
  const CodecEncoded found = encoded(model);
  const auto fine = encode_hac(model, {WeightBits::all(16)}, executor);
  REQUIRE(fine.ok());
  for (const int bits : {6, 8, 10, 12, 16}) {
    const auto common = encode_hac(model, {WeightBits::all(bits)}, executor);
    REQUIRE(common.ok());
    CHECK(static_cast<double>(found.bytes.size()) < 1.002 * static_cast<double>(common->bytes.size()));
  }
  CHECK(found.report.bytes_of(HacFormat::context) < fine->report.bytes_of(HacFormat::context) * 6 / 10);
  // Fewer bits must not be bought with larger steps: errors are the same on average.
  const auto error_of = [&](const CodecModel& coded) {
    double sum = 0;
    std::vector<Voxel> unmasked;
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < model.anchors(); ++i) {
      if (model.mask[i] == 0) continue;
      unmasked.push_back(model.voxels[i]);
      rows.push_back(i);
    }
    const std::vector<std::uint32_t> order = morton_order(unmasked, voxel_range(unmasked));
    for (std::size_t i = 0; i < order.size(); ++i) {
      for (std::size_t c = 0; c < 12; ++c) {
        const double error = static_cast<double>(coded.feature[12 * i + c]) - model.feature[12 * rows[order[i]] + c];
        sum += error * error;
      }
    }
    return sum;
  };
  const double ratio = error_of(found.model) / error_of(fine->model);
  CHECK(ratio < 1.03);
  CHECK(ratio > 0.97);
}

TEST_CASE("hac/hac: no anchors, one anchor, anchors without unmasked offsets") {
  CodecModel none = make_codec_model(7, {.anchors = 0});
  CHECK(decoded(encoded(none).bytes).model.anchors() == 0);
  CHECK(encoded(decoded(encoded(none).bytes).model).bytes == encoded(none).bytes);
  const CodecModel one = make_codec_model(10, {.anchors = 1});
  REQUIRE(one.mask[0] != 0);
  CHECK(same(decoded(encoded(one).bytes).model, encoded(one).model));
  CodecModel masked = make_codec_model(7, {.anchors = 20});
  std::fill(masked.mask.begin(), masked.mask.end(), 0u);
  const CodecEncoded file = encoded(masked);
  CHECK(file.report.dropped == 20);
  CHECK(decoded(file.bytes).model.anchors() == 0);
}

TEST_CASE("hac/hac: a value far out costs a few bytes, and beyond the greatest symbol it is held there and counted") {
  CodecModel model = make_codec_model(11);
  std::size_t row = 0;
  while (model.mask[row] == 0) ++row;
  const std::size_t before = encoded(model).bytes.size();
  model.feature[row * 6] = 10'000;
  const CodecEncoded outlier = encoded(model);
  CHECK(outlier.bytes.size() < before + 8);
  CHECK(outlier.report.clamped[0] == 0);
  model.feature[row * 6] = 3e9f;
  const CodecEncoded held = encoded(model);
  CHECK(held.report.clamped[0] == 1);
  CHECK(same(decoded(held.bytes).model, held.model));
  CHECK(encoded(held.model).bytes == held.bytes);
}

TEST_CASE("hac/hac: what cannot be coded is refused in a sentence") {
  SerialExecutor executor;
  const CodecModel good = make_codec_model(12, {.anchors = 40});
  const auto refused = [&](const CodecModel& model) {
    const auto result = encode_hac(model, {}, executor);
    return !result.ok() && !result.error().problem.empty() && !result.error().remedy.empty();
  };
  REQUIRE(!refused(good));
  std::size_t unmasked = 0;
  while (good.mask[unmasked] == 0) ++unmasked;
  const auto changed = [&](const auto& change) {
    CodecModel model = good;
    change(model);
    return refused(model);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  CHECK(changed([&](CodecModel& m) { m.feature[6 * unmasked] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.scale[6 * unmasked] = infinity; }));
  CHECK(changed([&](CodecModel& m) { m.scale[6 * unmasked] = -0.001f; }));
  CHECK(changed([&](CodecModel& m) { m.mask[unmasked] = 8; }));
  CHECK(changed([&](CodecModel& m) { m.offset.pop_back(); }));
  CHECK(changed([&](CodecModel& m) { m.voxel_size = 0; }));
  CHECK(changed([&](CodecModel& m) { m.voxel_size = nan; }));
  CHECK(changed([&](CodecModel& m) { m.feature_dim = 0; }));
  CHECK(changed([&](CodecModel& m) { m.offset_count = 33; }));
  CHECK(changed([&](CodecModel& m) { m.base_step[1] = -1; }));
  CHECK(changed([&](CodecModel& m) { m.chunk_anchors = 0; }));
  CHECK(changed([&](CodecModel& m) { m.trained.reset(); }));
  CHECK(changed([&](CodecModel& m) { m.trained->signs.pop_back(); }));
  CHECK(changed([&](CodecModel& m) { m.trained->weight1[0] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.trained->box[0] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.networks[0].values[0] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.networks[0].shape[0] = 8; }));
  CHECK(changed([&](CodecModel& m) {
    m.networks[0].shape = {0};
    m.networks[0].values.clear();
  }));
  // An offset that is not unmasked may be anything.
  CodecModel model = good;
  model.mask[unmasked] = 1;
  model.offset[9 * unmasked + 8] = nan;
  CHECK(!refused(model));
}

}  // namespace
