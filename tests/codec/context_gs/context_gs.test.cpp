// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "support/cmk_file.hpp"
#include "support/context_gs_model.hpp"

namespace {

using namespace compmark;
using testing::decoded;
using testing::encoded;
using testing::make_context_gs_model;
using testing::same;

TEST_CASE("context_gs/context_gs: a file decodes to the encoder's own quantised model, to the last bit") {
  const CodecModel model = make_context_gs_model(1);
  const CodecEncoded file = encoded(model);
  const CodecDecoded back = decoded(file.bytes);
  CHECK(back.verified);
  CHECK(back.damaged.empty());
  CHECK(same(back.model, file.model));
  CHECK(file.report.anchors + file.report.dropped == model.anchors());
  CHECK(file.report.dropped > 0);
  CHECK(file.report.clamped == std::array<std::uint64_t, 3>{});
  const auto& levels = file.report.level_anchors;
  CHECK(levels[0] + levels[1] + levels[2] == file.report.anchors);
  CHECK(levels[2] > 0);
  CHECK(levels[1] > levels[2]);
  CHECK(levels[0] > levels[1]);
  // Every coded value is within half a step of what it was (a step is at most 2 Q0), and z is what it was. The order is
  // that of the levels of the anchors, along the Morton curve within each: a decoder sorts them out of the voxels
  // alone.
  std::vector<Voxel> curve;
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < model.anchors(); ++i) {
    if (model.mask[i] == 0) continue;
    curve.push_back(model.voxels[i]);
    rows.push_back(i);
  }
  const std::vector<std::uint32_t> order = morton_order(curve, voxel_range(curve));
  AnchorLevels split;
  split.sort(curve, model.trained_gs->cells);
  split.assign();
  std::size_t i = 0;
  for (int level = 2; level >= 0; --level) {
    for (const std::uint32_t at : order) {
      if (split.level()[at] != level) continue;
      const std::size_t row = rows[at];
      REQUIRE(back.model.voxels[i] == model.voxels[row]);
      REQUIRE(back.model.mask[i] == model.mask[row]);
      for (std::size_t c = 0; c < 12; ++c) REQUIRE(back.model.hyperprior[12 * i + c] == model.hyperprior[12 * row + c]);
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
      ++i;
    }
  }
  CHECK(i == back.model.anchors());
}

TEST_CASE("context_gs/context_gs: encoding what was decoded gives the same bytes") {
  for (const std::uint64_t seed : {2u, 3u, 4u}) {
    CodecModel model = make_context_gs_model(seed, {.anchors = 150 * seed});
    for (std::size_t i = 10; i < 40; ++i) model.voxels[i] = model.voxels[9];  // several in one voxel
    testing::check_round_trip(model);
  }
}

TEST_CASE("context_gs/context_gs: bytes and model are the same at any number of threads") {
  testing::check_any_threads(make_context_gs_model(5, {.anchors = 700}));
}

TEST_CASE("context_gs/context_gs: the file is as large as its tables say, and the report counts every byte") {
  const CodecEncoded file = encoded(make_context_gs_model(6, testing::full_codec_model(1200)), {WeightBits::all(8)});
  const CodecReport& report = file.report;
  std::uint64_t sum = report.container_bytes + report.extra_bytes;
  for (const auto& [kind, bytes] : report.section_bytes) sum += bytes;
  CHECK(sum == report.total_bytes);
  CHECK(report.total_bytes == file.bytes.size());
  CHECK(report.hyperprior_symbols == 12 * report.anchors);
  // 25 bytes a stream, of which there are two a level here
  CHECK(std::abs(report.estimated_bytes() - static_cast<double>(report.total_bytes)) < 6 * 25 + 10);
  MESSAGE("1200 anchors: ", report.total_bytes, " bytes; GEOM ", report.bytes_of(CodecFormat::geometry), ", LVLS ",
          report.bytes_of(ContextGsFormat::levels), ", PRIO ", report.bytes_of(ContextGsFormat::prior), ", HYPR ",
          report.bytes_of(ContextGsFormat::hyperprior), ", MASK ", report.bytes_of(CodecFormat::mask), ", NETC ",
          report.bytes_of(CodecFormat::context), ", STRM ", report.bytes_of(CodecFormat::stream), "; the tables say ",
          report.estimated_bytes());
}

TEST_CASE(
    "context_gs/context_gs: parents predict: another parent, or a parent's attribute shuffled, makes a larger file") {
  const CodecModel model = make_context_gs_model(14, {.anchors = 1500, .feature_dim = 12, .hidden = 40});
  const CodecEncodeSettings settings{WeightBits::all(12)};
  const CodecEncoded file = encoded(model, settings);
  const auto bits = [&](const CodecEncoded& f) {
    return f.report.ideal_bits[0] + f.report.ideal_bits[1] + f.report.ideal_bits[2];
  };
  CodecModel other = model;  // other cells, other parents
  other.trained_gs->cells.fine = model.trained_gs->cells.fine * 2 + 1;
  other.trained_gs->cells.coarse = model.trained_gs->cells.coarse * 2 + 1;
  CHECK(bits(encoded(other, settings)) > 1.05 * bits(file));
  other = model;  // z of another anchor
  std::rotate(other.hyperprior.begin(), other.hyperprior.begin() + 12, other.hyperprior.end());
  CHECK(bits(encoded(other, settings)) > 1.05 * bits(file));
}

TEST_CASE(
    "context_gs/context_gs: the bits that are found for the networks' weights make a smaller file than any common "
    "number") {
  const CodecModel model = make_context_gs_model(14, {.anchors = 900, .feature_dim = 12, .hidden = 40});
  const CodecEncoded found = encoded(model), fine = encoded(model, {WeightBits::all(16)});
  for (const int bits : {2, 4, 6, 8, 10, 12}) {
    const CodecEncoded common = encoded(model, {WeightBits::all(bits)});
    CHECK(static_cast<double>(found.bytes.size()) < 1.002 * static_cast<double>(common.bytes.size()));
  }
  CHECK(found.report.bytes_of(CodecFormat::context) < fine.report.bytes_of(CodecFormat::context) * 6 / 10);
}

TEST_CASE("context_gs/context_gs: no anchors, one anchor, anchors without unmasked offsets, all in one voxel") {
  CodecModel none = make_context_gs_model(7, {.anchors = 0});
  CHECK(decoded(encoded(none).bytes).model.anchors() == 0);
  CHECK(encoded(decoded(encoded(none).bytes).model).bytes == encoded(none).bytes);
  const CodecModel one = make_context_gs_model(10, {.anchors = 1});
  REQUIRE(one.mask[0] != 0);
  CHECK(same(decoded(encoded(one).bytes).model, encoded(one).model));
  CHECK(encoded(one).report.level_anchors == std::array<std::uint64_t, 3>{0, 0, 1});
  CodecModel masked = make_context_gs_model(7, {.anchors = 20});
  std::fill(masked.mask.begin(), masked.mask.end(), 0u);
  const CodecEncoded file = encoded(masked);
  CHECK(file.report.dropped == 20);
  CHECK(decoded(file.bytes).model.anchors() == 0);
  CodecModel heap = make_context_gs_model(8, {.anchors = 50});
  std::fill(heap.voxels.begin(), heap.voxels.end(), heap.voxels[0]);
  const CodecEncoded heaped = encoded(heap);
  CHECK(heaped.report.level_anchors[2] == 1);
  CHECK(heaped.report.level_anchors[1] == 0);
  CHECK(same(decoded(heaped.bytes).model, heaped.model));
  CHECK(encoded(heaped.model).bytes == heaped.bytes);
}

TEST_CASE("context_gs/context_gs: values and hyperpriors far out cost a few bytes, and inputs are held, not wrapped") {
  CodecModel model = make_context_gs_model(11);
  std::size_t row = 0;
  while (model.mask[row] == 0) ++row;
  const std::size_t before = encoded(model, {WeightBits::all(10)}).bytes.size();
  model.hyperprior[12 * row] = HyperpriorFormat::greatest;
  model.hyperprior[12 * row + 1] = -HyperpriorFormat::greatest;
  const CodecEncoded far = encoded(model, {WeightBits::all(10)});
  CHECK(far.bytes.size() < before + 100);
  CHECK(same(decoded(far.bytes).model, far.model));
  for (std::size_t i = 0; i < model.anchors(); ++i) model.feature[6 * i] = 3e9f;  // parents too
  const CodecEncoded held = encoded(model, {WeightBits::all(10)});
  CHECK(held.report.clamped[0] == held.report.anchors);
  CHECK(same(decoded(held.bytes).model, held.model));
  CHECK(encoded(held.model).bytes == held.bytes);
}

TEST_CASE("context_gs/context_gs: what cannot be coded is refused in a sentence") {
  SerialExecutor executor;
  const CodecModel good = make_context_gs_model(12, {.anchors = 40});
  const auto refused = [&](const CodecModel& model) {
    const auto result = encode_context_gs(model, {}, executor);
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
  const float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(changed([&](CodecModel& m) { m.feature[6 * unmasked] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.scale[6 * unmasked] = -0.001f; }));
  CHECK(changed([&](CodecModel& m) { m.hyperprior.pop_back(); }));
  CHECK(changed([&](CodecModel& m) { m.hyperprior.clear(); }));
  CHECK(changed([&](CodecModel& m) { m.hyperprior[12 * unmasked] = HyperpriorFormat::greatest + 1; }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs.reset(); }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->cells.fine = 0; }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->network[1].weight1[0] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->network[2].weight1.pop_back(); }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->box[0] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->statistics[0] = nan; }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->statistics[6 + 6 + 9] = 0; }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->prior[3] = -0.1; }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->prior[3] = nan; }));
  CHECK(changed([&](CodecModel& m) { std::fill_n(m.trained_gs->prior.begin(), 31, 0.5); }));
  CHECK(changed([&](CodecModel& m) { m.trained_gs->prior.pop_back(); }));
  CHECK(changed([&](CodecModel& m) { m.networks[0].values[0] = nan; }));
}

}  // namespace
