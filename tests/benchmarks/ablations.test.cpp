// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The ablations' program without its trainings: what is found again and what is not, what the tables say of finished
// runs, and the entropy model without its noise.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "ablations/record.hpp"
#include "ablations/report.hpp"
#include "ablations/rows.hpp"
#include "ablations/switched_noise.hpp"
#include "ablations/tables.hpp"
#include "compmark/codec/hac/hac_model.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/io/atomic_file.hpp"
#include "support/tool.hpp"

namespace {

using namespace ablation;
using compmark::testing::ScratchFolder;

Record record(const std::string& scene, const std::string& row, std::uint64_t seed, double accuracy, double psnr) {
  Record r;
  r.scene = scene;
  r.row = row;
  r.seed = seed;
  r.before = {accuracy + 0.01, 0.5, psnr + 1, 0.9};
  r.after = {accuracy, 0.4, psnr, 0.8};
  r.anchors = 1000;
  r.file_bytes = 2048;
  r.seconds = 1.5;
  r.settings = {{"iterations", 1500}, {"voxel_size", 0.01}};
  return r;
}

const FilledLine& line_of(const FilledTable& table, const std::string& row) {
  const auto found = std::find_if(table.lines.begin(), table.lines.end(),
                                  [&](const FilledLine& line) { return line.line.row == row; });
  REQUIRE(found != table.lines.end());
  return *found;
}

TableOfPaper table_named(const std::string& name) {
  for (const TableOfPaper& table : tables_of_paper()) {
    if (table.name == name) return table;
  }
  FAIL("no such table");
  return {};
}

}  // namespace

TEST_CASE("ablations: rows are told apart by their names, and every line of a table is one of them") {
  std::set<std::string> names;
  for (const Row& row : all_rows()) CHECK(names.insert(row.name).second);
  CHECK(all_rows()[0].name == unmarked_name);
  CHECK_FALSE(all_rows()[0].message);
  for (const TableOfPaper& table : tables_of_paper()) {
    CAPTURE(table.name);
    bool has_reference = false;
    for (const Line& line : table.lines) {
      CHECK(names.count(line.row) == 1);
      has_reference = has_reference || line.row == table.reference;
    }
    CHECK(has_reference);
  }
}

TEST_CASE("ablations: a finished training is found again with the same settings alone") {
  const ScratchFolder folder("compmark-ablations-test");
  std::filesystem::create_directories(folder.path / "runs");
  const Record written = record("still_life", "full", 1, 0.9375, 27.123456789012345);
  Record found;
  CHECK(find_record(folder.path, "still_life", "full", 1, written.settings, found) == Found::nothing);
  REQUIRE(write_record(folder.path, written));
  REQUIRE(find_record(folder.path, "still_life", "full", 1, written.settings, found) == Found::finished);
  CHECK(record_json(found).dump() == record_json(written).dump());
  CHECK(found.after.psnr == written.after.psnr);
  std::size_t files = 0;  // nothing half written stays beside it
  for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator(folder.path / "runs")) ++files;
  CHECK(files == 1);

  CHECK(find_record(folder.path, "still_life", "full", 2, written.settings, found) == Found::nothing);
  CHECK(find_record(folder.path, "closer", "full", 1, written.settings, found) == Found::nothing);
  nlohmann::ordered_json other = written.settings;
  other["iterations"] = 1501;
  CHECK(find_record(folder.path, "still_life", "full", 1, other, found) == Found::other_settings);

  const std::filesystem::path path = record_path(folder.path, "still_life", "full", 1);
  for (const std::string text : {"", "{\"schema\": \"compmark.abl", "[]", "{\"schema\": \"compmark.ablation.1\"}",
                                 "{\"schema\": \"compmark.ablation.9\"}"}) {
    CAPTURE(text);
    REQUIRE(compmark::write_file(path, text));
    CHECK(find_record(folder.path, "still_life", "full", 1, written.settings, found) == Found::unreadable);
  }
  REQUIRE(compmark::write_json(path, record_json(record("still_life", "offset", 1, 1, 20))));  // under another's name
  CHECK(find_record(folder.path, "still_life", "full", 1, written.settings, found) == Found::unreadable);
}

TEST_CASE("ablations: directions") {
  CHECK(direction_of(-2.0, {-1.0, -1.1, -0.9}) == Direction::agrees);
  CHECK(direction_of(2.0, {-1.0, -1.1, -0.9}) == Direction::disagrees);
  CHECK(direction_of(-2.0, {-1.0, 1.1, -0.9}) == Direction::too_close);
  CHECK(direction_of(-2.0, {0.0, 0.0}) == Direction::too_close);
  CHECK(direction_of(-2.0, {-0.1}) == Direction::agrees);  // one pair has no error
  CHECK(direction_of(-2.0, {}) == Direction::not_run);
  CHECK(direction_of(std::nullopt, {1.0, 1.0}) == Direction::no_paper);
}

TEST_CASE("ablations: tables are means over scenes and seeds, differences of pairs") {
  std::vector<Record> records;
  double shift = 0;  // scenes and seeds differ by more than rows do
  for (const char* scene : {"a", "b"}) {
    for (const std::uint64_t seed : {0u, 1u}) {
      records.push_back(record(scene, "unmarked", seed, 0, 30 + 5 * shift));
      records.push_back(record(scene, "full", seed, 0.9 - 0.1 * shift, 29 + 5 * shift));
      records.push_back(record(scene, "position", seed, 0.6 - 0.1 * shift, 29.5 + 5 * shift));
      records.push_back(record(scene, "bits_32", seed, 0.95 - 0.1 * shift, 29 + 5 * shift));
      shift += 1;
    }
  }
  const FilledTable target = fill(table_named("T4"), records);
  const FilledLine& full = line_of(target, "full");
  CHECK(full.reference);
  CHECK(full.accuracy_after.count == 4);
  CHECK(full.accuracy_after.mean == doctest::Approx(0.75));
  CHECK(full.accuracy_after.deviation == doctest::Approx(0.1 * std::sqrt(5.0 / 3)));
  CHECK(full.accuracy_before.mean == doctest::Approx(0.76));
  CHECK(full.worst_after == 0.4);
  CHECK(full.lost_after.mean == doctest::Approx(1));
  CHECK(full.lost_after.deviation == doctest::Approx(0).epsilon(1e-9));
  const FilledLine& position = line_of(target, "position");
  CHECK(position.accuracy_difference.mean == doctest::Approx(-30));  // points
  CHECK(position.accuracy_direction == Direction::agrees);
  CHECK(position.psnr_direction == Direction::disagrees);  // the paper loses 15 dB
  CHECK(line_of(target, "offset").accuracy_direction == Direction::not_run);
  CHECK(line_of(target, "offset").accuracy_after.count == 0);

  const FilledTable capacity = fill(table_named("T3"), records);
  CHECK(line_of(capacity, "bits_32").accuracy_direction == Direction::agrees);
  CHECK(line_of(capacity, "bits_32").psnr_direction == Direction::no_paper);

  // A row without its counterpart or its partner counts for the means alone.
  records.push_back(record("c", "position", 0, 0.5, 10));
  const FilledLine alone = line_of(fill(table_named("T4"), records), "position");
  CHECK(alone.accuracy_after.count == 5);
  CHECK(alone.lost_after.count == 4);
  CHECK(alone.accuracy_difference.count == 4);
}

TEST_CASE("ablations: the report names what disagrees and what was not run, with and without runs") {
  const ScratchFolder folder("compmark-ablations-report-test");
  const ReportHead head{1500, 1, {{"a", 96, 96, 40, 8}}};
  REQUIRE(write_report(folder.path, head, {}));
  const std::vector<Record> records{record("a", "unmarked", 0, 0, 30), record("a", "full", 0, 0.9, 29),
                                    record("a", "position", 0, 0.95, 28)};
  REQUIRE(write_report(folder.path, head, records));
  const std::string markdown = report_markdown(head, records);
  CHECK(markdown.find("DISAGREES") != std::string::npos);
  CHECK(markdown.find("not run") != std::string::npos);
  CHECK(markdown.find("nan") == std::string::npos);
  const auto json = compmark::read_json<nlohmann::ordered_json>(folder.path / "ablations.json");
  REQUIRE(json.ok());
  CHECK((*json)["tables"].size() == 4);
  CHECK((*json)["runs"].size() == 3);
  CHECK((*json)["tables"][0]["lines"][0]["direction"]["bit_accuracy"] == "DISAGREES");
  CHECK(std::filesystem::file_size(folder.path / "ablations.html") > 2000);
}

TEST_CASE(
    "ablations: without noise an entropy model changes no attribute, and adds the rate's gradient to the render's") {
  using namespace compmark;
  constexpr HashGridShape small{.volume_resolution = {9, 18},
                                .volume_levels = 2,
                                .volume_cap_log2 = 9,
                                .plane_resolution = {20},
                                .plane_levels = 1,
                                .plane_cap_log2 = 8};
  constexpr int features = 5, offsets = 2;
  constexpr std::size_t anchors = 70;
  using Model = SwitchedNoise<HacModel<float, features, offsets, small>>;
  ParameterArena<float> arena;
  const BlockHandle position =
      arena.add("anchor.position", anchors, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  const Model::Handles handles = Model::add_parameters(arena, anchors);
  Model::initialise(arena, handles, 5);
  const Random random(1, 0, random_stage("ablations test"));
  std::uint64_t at = 0;
  for (float& value : arena.values(position).flat()) value = static_cast<float>(random.uniform(at++));
  using Table = std::vector<float>;
  const std::size_t width[3] = {features, 6, 3 * offsets};
  std::vector<Table> plain(3), slope(3);
  for (std::size_t t = 0; t < 3; ++t) {
    for (std::size_t i = 0; i < anchors * width[t]; ++i) {
      plain[t].push_back(static_cast<float>(random.normal(at++)) - (t == 1 ? 4.0f : 0.0f));
      slope[t].push_back(static_cast<float>(random.normal(at++)));
    }
  }
  const auto view = [&](std::vector<Table>& tables, std::size_t t) {
    return MatrixView<float>{tables[t].data(), anchors, width[t]};
  };
  const auto constant = [&](std::size_t t) { return MatrixView<const float>{plain[t].data(), anchors, width[t]}; };
  Model::begin_context(arena, handles, std::as_const(arena).values(position), constant(0), constant(1), constant(2));
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < anchors; row += 2) rows.push_back(row);
  const Model::Phase phase{.context = true, .seed = 3, .iteration = 12};
  SerialExecutor executor;
  const auto pass = [&](bool noise, std::vector<Table>& values, std::vector<Table>& gradients) {
    Model::Settings settings;
    settings.lambda = 40;
    settings.sample = 1;
    settings.noise = noise;
    const Model model(settings);
    Model::Context context;
    values = plain;
    std::fill(arena.all_gradients().begin(), arena.all_gradients().end(), 0.0f);
    const RateReport report = model.forward(arena, handles, rows, phase, std::as_const(arena).values(position),
                                            view(values, 0), view(values, 1), view(values, 2), context, executor);
    CHECK(report.bits_per_scalar > 0);
    model.backward(arena, handles, rows, view(gradients, 0), view(gradients, 1), view(gradients, 2), context, executor);
  };
  std::vector<Table> values, with_render = slope,
                             rate_alone{Table(slope[0].size()), Table(slope[1].size()), Table(slope[2].size())};
  pass(true, values, with_render);
  CHECK(values != plain);  // the control
  with_render = slope;
  pass(false, values, with_render);
  CHECK(values == plain);
  pass(false, values, rate_alone);
  double rate = 0;
  for (std::size_t t = 0; t < 3; ++t) {
    for (std::size_t i = 0; i < slope[t].size(); ++i) {
      CHECK(with_render[t][i] == slope[t][i] + rate_alone[t][i]);
      rate += std::abs(static_cast<double>(rate_alone[t][i]));
    }
  }
  CHECK(rate > 0);
}
