// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The fidelity table: what it says of finished cells, what it refuses, and one cell from nothing to its row.
#include <doctest/doctest.h>

#include <array>
#include <chrono>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "fidelity/cell.hpp"
#include "fidelity/fitted.hpp"
#include "fidelity/process.hpp"
#include "fidelity/table.hpp"
#include "tool/running.hpp"

namespace fidelity_test {

namespace {

using namespace compmark;
using namespace fidelity;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::run_tool;
using testing::ScratchFolder;
using testing::text_of;
using testing::times_in;

/// The files of a finished cell, as the tool writes them.
void write_cell(const Cell& cell, const Settings& settings, const std::array<double, 4>& psnr,
                const std::array<double, 4>& bytes, const std::array<double, 4>& accuracy) {
  REQUIRE(open_cell(cell, settings).ok());
  const fs::path folder = cell.folder(settings);
  fs::create_directories(folder / "unmarked");
  REQUIRE(write_json(folder / "results.json", nlohmann::json{{"train_seconds", 120.0}}).ok());
  REQUIRE(write_json(folder / "unmarked/results.json", nlohmann::json{{"train_seconds", 600.0}}).ok());
  REQUIRE(write_json(folder / "decoder.json", nlohmann::json{{"seconds", 60.0}}).ok());
  nlohmann::json models = nlohmann::json::array();
  for (std::size_t m = 0; m < 4; ++m) {
    models.push_back({{"psnr", psnr[m]},
                      {"ssim", 0.9},
                      {"bytes", bytes[m]},
                      {"bit_accuracy", {{"mean", accuracy[m]}, {"min", accuracy[m] - 0.1}, {"views", 7}}},
                      {"p_value", 1e-9},
                      {"largest_view_p_value", 1e-7}});
  }
  REQUIRE(write_json(folder / "evaluate.json", nlohmann::json{{"models", std::move(models)}}).ok());
}

}  // namespace

TEST_CASE("fidelity: a row is what the tool wrote, and the table shows what the mark and the codec cost of it") {
  const ScratchFolder scratch("compmark-fidelity-test");
  Settings settings;
  settings.out = scratch.path;
  const Cell lego{{"data/lego", "lego", 2}, "hac"}, chair{{"data/chair", "chair", 1}, "hac"};
  write_cell(lego, settings, {35, 34, 34.75, 33.9}, {8e6, 500e3, 8e6, 510e3}, {0.5, 0.45, 0.99, 0.98});
  write_cell(chair, settings, {33, 32, 32.75, 31.7}, {4e6, 300e3, 4e6, 303e3}, {0.5, 0.55, 1.0, 1.0});
  const Result<Row> row = read_row(lego, settings), other = read_row(chair, settings);
  REQUIRE(row.ok());
  REQUIRE(other.ok());
  CHECK(row->lost(false) == doctest::Approx(0.25));
  CHECK(row->lost(true) == doctest::Approx(0.1));
  CHECK(row->more_bytes() == doctest::Approx(0.02));
  CHECK(row->lost_points() == doctest::Approx(1));
  CHECK(row->models[marked_coded].worst == doctest::Approx(0.88));
  CHECK(row->train_seconds == 600);

  const Grid grid = fidelity_grid({*row, *other});
  REQUIRE(grid.rows.size() == 2 * 2 + 2 + 2);  // two cells, the mean of HAC and none of ContextGS, the paper's
  CHECK(grid.rows[1][2] == "99.00 / 98.00");
  CHECK(grid.rows[0][2] == "–");  // of what is not marked no share of bits is right
  CHECK(grid.rows[4][0] == "mean of 2");
  CHECK(grid.rows[4][3] == "34.00 / 33.00");
  CHECK(grid.rows[5][2] == "99.50 / 99.00");
  CHECK(grid.rows[5][5] == "–");  // no weights were given
  CHECK(grid.rows[1][6] == "8.00 / 0.510");
  for (const Grid& each : {grid, cost_grid({*row, *other})}) {
    for (const auto& line : each.rows) CHECK(line.size() == each.columns.size());
  }
  REQUIRE(write_table(settings, {*row, *other}).ok());
  const nlohmann::json json = json_of(scratch.path / "fidelity.json");
  REQUIRE(json["rows"].size() == 2);
  CHECK(json["rows"][1]["scene"] == "chair");
  CHECK(json["rows"][1]["psnr_cost_after"].get<double>() == doctest::Approx(0.3));
  CHECK(times_in(text_of(scratch.path / "fidelity.md"), "HAC + CompMarkGS") == 1);
  CHECK(times_in(text_of(scratch.path / "fidelity.html"), "lego_hac/evaluate.html") == 1);

  // What an earlier command finished is found again, that of other settings is not.
  const std::vector<Row> found = finished_rows(settings);
  REQUIRE(found.size() == 2);
  CHECK(found[0].scene == "chair");
  CHECK(found[1].models[marked_coded].psnr == row->models[marked_coded].psnr);
  Settings other_settings = settings;
  other_settings.rate_lambda = 0.001;
  CHECK(finished_rows(other_settings).empty());
}

TEST_CASE("fidelity: a folder of other settings, a step that is not over and a file that is none are told apart") {
  const ScratchFolder scratch("compmark-fidelity-refused-test");
  Settings settings;
  settings.out = scratch.path;
  const Cell cell{{"data/lego", "lego", 2}, "context_gs"};
  CHECK_FALSE(is_trained(cell.folder(settings)));
  write_cell(cell, settings, {35, 34, 34.75, 33.9}, {8e6, 500e3, 8e6, 510e3}, {0.5, 0.45, 0.99, 0.98});
  const fs::path folder = cell.folder(settings);
  CHECK(is_trained(folder));
  CHECK(is_measured(folder, settings));
  REQUIRE(open_cell(cell, settings).ok());
  Settings longer = settings;
  longer.iterations = 30000;
  const Result<Done> refused = open_cell(cell, longer);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().line().find("cell.json") != std::string::npos);
  Settings careful = settings;
  careful.extra = {"--checkpoint-every", "50", "--memory-budget=500"};
  CHECK(open_cell(cell, careful).ok());  // the same models
  careful.extra = {"--checkpoint-every", "50", "--seed", "3"};
  CHECK_FALSE(open_cell(cell, careful).ok());
  const Cell refused_words{{"data/cup", "cup", 1},
                           "hac"};  // nothing was trained: the next settings may have the folder
  REQUIRE(open_cell(refused_words, careful).ok());
  CHECK(open_cell(refused_words, settings).ok());
  Settings with_lpips = settings;
  with_lpips.lpips = "alex.safetensors";
  CHECK_FALSE(is_measured(folder, with_lpips));
  // Trained again, it is measured again.
  fs::last_write_time(folder / "results.json", fs::last_write_time(folder / "evaluate.json") + std::chrono::seconds(1));
  CHECK_FALSE(is_measured(folder, settings));
  REQUIRE(write_file(folder / "checkpoint.safetensors", std::string("x")).ok());
  CHECK_FALSE(is_trained(folder));

  REQUIRE(write_file(folder / "evaluate.json", std::string("{\"models\": []}")).ok());
  const Result<Row> row = read_row(cell, settings);
  REQUIRE_FALSE(row.ok());
  CHECK(row.error().line().find("evaluate.json") != std::string::npos);
}

TEST_CASE("fidelity: words reach the tool as they are, and its exit code comes back") {
  const ScratchFolder scratch("compmark-fidelity-process-test");
  const fs::path output = scratch.path / "said.txt";
  const Result<int> said = run_program({"sh", "-c", "printf '%s' \"$1\"; exit 3", "sh", "a $(b) \"c\" 'd'"}, output);
  REQUIRE(said.ok());
  CHECK(*said == 3);
  CHECK(text_of(output) == "a $(b) \"c\" 'd'");
  const Result<int> killed = run_program({"sh", "-c", "kill -INT $$"}, output);
  REQUIRE(killed.ok());
  CHECK(*killed == 128 + 2);
  CHECK_FALSE(run_program({(scratch.path / "nothing").string()}, output).ok());
}

TEST_CASE("fidelity: one command trains a cell whose decoder is fitted to it, and goes on where it was") {
  const ScratchFolder scratch("compmark-fidelity-run-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("scenes/one") + " --width 64 --height 64 --train 12 --test 3");
  fs::create_directories(at("scenes/empty"));
  const std::string command = "--data " + at("scenes") + " --out " + at("run") +
                              " --codecs hac --bits 16 --mark-iterations 100 --message-rate 0.01 --fidelity 50 "
                              "--voxel-size 0.2 --iterations ";
  const auto run = [](const std::string& arguments) { return run_tool(COMPMARK_REPRODUCE_FIDELITY, arguments); };
  const Outcome outcome = run(command + "200");
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  CHECK(outcome.text.find("no scene") != std::string::npos);  // the empty folder is named
  const nlohmann::json row = json_of(at("run/fidelity.json"))["rows"][0];
  CHECK(row["scene"] == "one");
  const nlohmann::json results = json_of(at("run/one_hac/results.json"))["compressed"];
  CHECK(row["marked_after"]["bytes"] == results["bytes"]);
  CHECK(row["marked_after"]["psnr"].get<double>() == doctest::Approx(results["test"]["psnr"].get<double>()));
  CHECK(row["marked_after"]["bit_accuracy"]["mean"].get<double>() >
        row["unmarked_after"]["bit_accuracy"]["mean"].get<double>());
  CHECK(fs::exists(at("run/one_hac/evaluate.html")));

  const fs::file_time_type trained = fs::last_write_time(at("run/one_hac/model.cmk"));
  fs::remove(at("run/one_hac/evaluate.json"));
  REQUIRE(run(command + "200").code == 0);
  CHECK(fs::last_write_time(at("run/one_hac/model.cmk")) == trained);
  CHECK(fs::exists(at("run/one_hac/evaluate.json")));
  CHECK(run(command + "300").code == 1);  // other settings in this folder
  CHECK(run(command + "200 --decoder x").code == 2);
  CHECK(run(command + "200 --decoder=x").code == 2);
  CHECK(run(command + "twice").code == 2);
  CHECK(run(command + "200 --resume").code == 0);  // it always does
  CHECK(fs::last_write_time(at("run/one_hac/model.cmk")) == trained);
  CHECK(run("--data " + at("scenes/empty") + " --out " + at("nothing")).code == 2);
  CHECK(run("--data " + at("scenes/one@half") + " --out " + at("nothing")).code == 2);
  CHECK_FALSE(fs::exists(at("nothing")));
}

TEST_CASE("fidelity: words go to the command of a fitted cell that takes them") {
  const DividedWords words =
      divide({"--voxel-size", "0.2", "--fidelity", "50", "--seed=3", "--mark-iterations=100", "--message-rate", "0.01",
              "--checkpoint-every", "9", "--effects", "none", "--period=0.2", "--tone", "0.01"});
  using Words = std::vector<std::string>;
  CHECK(words.host == Words{"--voxel-size", "0.2", "--seed=3", "--checkpoint-every", "9", "--effects", "none"});
  CHECK(words.codec == Words{"--seed=3", "--checkpoint-every", "9"});
  CHECK(words.mark == Words{"--fidelity", "50", "--seed=3", "--iterations=100", "--message-rate", "0.01",
                            "--checkpoint-every", "9", "--period=0.2", "--tone", "0.01"});
  CHECK(divide({"--mark-iterations"}).mark == Words{"--iterations"});  // which embed refuses
  // HAC has no ancestors, and embed would refuse to hold its steps.
  const Words held = {"--hold-steps", "9", "--hold-steps=8", "--fidelity", "50"};
  CHECK(words_for("hac", held) == Words{"--fidelity", "50"});
  CHECK(words_for("context_gs", held) == held);
}

TEST_CASE("fidelity: both codecs are fitted to one host, which stays what it was") {
  const ScratchFolder scratch("compmark-fidelity-fitted-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 64 --height 64 --train 12 --test 3");
  const std::string command = "--data " + at("one") + " --out " + at("run") +
                              " --bits 16 --mark-iterations 60 --message-rate 0.01 --fidelity 50 --voxel-size 0.2 "
                              "--iterations 150 --fit-codec ";
  const auto run = [](const std::string& arguments) { return run_tool(COMPMARK_REPRODUCE_FIDELITY, arguments); };
  const Outcome outcome = run(command + "100");
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  CHECK(times_in(outcome.text, ": host") == 1);
  CHECK(times_in(outcome.text, ": fit-codec") == 2);
  CHECK(times_in(outcome.text, ": embed") == 2);
  const nlohmann::json table = json_of(at("run/fidelity.json"));
  CHECK(table["fit_codec"] == 100);
  REQUIRE(table["rows"].size() == 2);
  const double host = json_of(at("run/one_host/results.json"))["train_seconds"].get<double>();
  for (const nlohmann::json& row : table["rows"]) {
    const std::string folder = "run/one_" + row["codec"].get<std::string>();
    CHECK(json_of(at(folder + "/unmarked/results.json"))["recipe"].get<std::string>().find("+fitted") !=
          std::string::npos);
    CHECK(row["marked_after"]["bytes"] == json_of(at(folder + "/results.json"))["compressed"]["bytes"]);
    CHECK(row["marked_after"]["bit_accuracy"]["mean"].get<double>() >
          row["unmarked_after"]["bit_accuracy"]["mean"].get<double>());
    CHECK(row["seconds"]["train"].get<double>() > host);
  }
  const fs::file_time_type trained = fs::last_write_time(at("run/one_host/model.safetensors"));
  fs::remove(at("run/one_hac/results.json"));  // as if its embedding had been stopped at the end
  CHECK(run(command + "100").code == 0);
  CHECK(fs::last_write_time(at("run/one_host/model.safetensors")) == trained);
  CHECK(run(command + "120").code == 1);  // another table
  CHECK(run(command + "0").code == 1);
  CHECK(run(command + "-1").code == 2);
}

TEST_CASE("fidelity: who stops it stops the training too, which writes its checkpoint first") {
  const ScratchFolder scratch("compmark-fidelity-stop-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 64 --height 64 --train 12 --test 3");
  const std::string arguments =
      " --codecs hac --voxel-size 0 --iterations 100000 --data " + at("one") + " --out " + at("run");
  // The parent alone is told, as by a batch system, once the training has begun.
  const Outcome outcome = run_tool(
      "sh", "-c '\"$0\" " + arguments + " & pid=$!; while [ ! -s " + at("run/one_hac/unmarked/log.jsonl") +
                " ]; do kill -0 $pid || exit 9; sleep 0.02; done; kill -TERM $pid; wait $pid; echo ended with $?' \"" +
                COMPMARK_REPRODUCE_FIDELITY + "\"");
  INFO(outcome.text);
  CHECK(outcome.text.find("ended with 130") != std::string::npos);
  CHECK(outcome.text.find("the same command goes on") != std::string::npos);
  CHECK(fs::exists(at("run/one_hac/unmarked/checkpoint.safetensors")));
  CHECK_FALSE(fs::exists(at("run/fidelity.json")));
}

}  // namespace fidelity_test
