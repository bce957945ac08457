// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The fidelity table: what it says of finished cells, what it refuses, and one cell from nothing to its row.
#include <doctest/doctest.h>

#include <array>
#include <chrono>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "fidelity/cell.hpp"
#include "fidelity/fitted.hpp"
#include "fidelity/run_cell.hpp"
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
    if (m >= 2) models.back().update({{"psnr_vs_unmarked", 40.0 + static_cast<double>(m)}, {"ssim_vs_unmarked", 0.99}});
  }
  REQUIRE(write_json(folder / "evaluate.json", nlohmann::json{{"models", std::move(models)}}).ok());
}

/// Runs reproduce_fidelity and stops it as soon as `log` has a line. The parent alone is told, as by a batch system.
Outcome stopped_at(const std::string& log, const std::string& arguments) {
  return run_tool("sh", "-c '\"$0\" " + arguments + " & pid=$!; while [ ! -s " + log +
                            " ]; do kill -0 $pid || exit 9; sleep 0.02; done; kill -TERM $pid; wait $pid; echo ended "
                            "with $?' \"" +
                            COMPMARK_REPRODUCE_FIDELITY + "\"");
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
  CHECK(json["rows"][1]["marked_before"]["psnr_vs_unmarked"] == 42);
  CHECK(json["rows"][1]["marked_after"]["psnr_vs_unmarked"] == 43);
  CHECK(json["rows"][1]["marked_after"]["ssim_vs_unmarked"] == 0.99);
  CHECK_FALSE(json["rows"][1]["unmarked_after"].contains("psnr_vs_unmarked"));
  CHECK(times_in(text_of(scratch.path / "fidelity.md"), "42.00 / 43.00") == 2);
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

  // Measured by an earlier version, which said nothing of the twin: a row all the same.
  nlohmann::json earlier = json_of(scratch.path / "lego_hac/evaluate.json");
  for (nlohmann::json& model : earlier["models"]) model.erase("psnr_vs_unmarked"), model.erase("ssim_vs_unmarked");
  REQUIRE(write_json(scratch.path / "lego_hac/evaluate.json", earlier).ok());
  CHECK(is_measured(scratch.path / "lego_hac", settings));
  const std::vector<Row> both = finished_rows(settings);
  REQUIRE(both.size() == 2);
  CHECK_FALSE(both[1].models[marked].psnr_vs_unmarked.has_value());
  CHECK_FALSE(table_json(settings, both)["rows"][1]["marked_before"].contains("psnr_vs_unmarked"));
}

TEST_CASE("fidelity: a cell of another key is in no table of this one's, and says so") {
  const ScratchFolder scratch("compmark-fidelity-key-test");
  Settings settings, other, unsaid;
  settings.out = other.out = unsaid.out = scratch.path;
  settings.key_id = testing::fixed_key(1, 48).id();
  other.key_id = testing::fixed_key(2, 48).id();
  const Cell lego{{"data/lego", "lego", 2}, "hac"}, chair{{"data/chair", "chair", 1}, "hac"};
  write_cell(lego, settings, {35, 34, 34.75, 33.9}, {8e6, 500e3, 8e6, 510e3}, {0.5, 0.45, 0.99, 0.98});
  CHECK(json_of(lego.folder(settings) / "cell.json")["key"] == settings.key_id);
  CHECK(open_cell(lego, settings).ok());
  CHECK(check_keys(settings).ok());
  CHECK(is_finished(lego, settings));
  CHECK(finished_rows(settings).size() == 1);

  CHECK_FALSE(is_of(lego, other));
  CHECK(finished_rows(other).empty());
  for (const Result<Done>& refused : {open_cell(lego, other), check_keys(other)}) {
    REQUIRE_FALSE(refused.ok());
    const std::string line = refused.error().line();
    INFO(line);
    for (const std::string& part :
         {std::string("cell.json"), settings.key_id, other.key_id, std::string("put that key back as owner.key")})
      CHECK(line.find(part) != std::string::npos);
  }
  // Other settings are named before a key that would not help.
  Settings longer = settings;
  longer.iterations = 30000;
  const Result<Done> refused = open_cell(lego, longer);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().line().find("other settings") != std::string::npos);

  // A cell of before the id was recorded is taken as it is, and its file is not written again.
  write_cell(chair, unsaid, {33, 32, 32.75, 31.7}, {4e6, 300e3, 4e6, 303e3}, {0.5, 0.55, 1.0, 1.0});
  const std::string before = text_of(chair.folder(unsaid) / "cell.json");
  CHECK(before.find("\"key\"") == std::string::npos);
  CHECK(open_cell(chair, settings).ok());
  CHECK(is_finished(chair, settings));
  CHECK(finished_rows(settings).size() == 2);
  CHECK(text_of(chair.folder(unsaid) / "cell.json") == before);
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

TEST_CASE("fidelity: wrong words are refused before the first cell, with the tool's sentence") {
  const ScratchFolder scratch("compmark-fidelity-words-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 32 --height 32 --train 4 --test 2");
  const std::string scene = "--data " + at("one") + " --out " + at("run") + " ";
  const auto run = [&](const std::string& words) { return run_tool(COMPMARK_REPRODUCE_FIDELITY, scene + words); };
  const auto sentence = [](const Outcome& outcome) {
    INFO(outcome.text);
    CHECK(outcome.code == 2);
    const std::string mark = ": error: ";
    const std::size_t begin = outcome.text.find(mark);
    REQUIRE(begin != std::string::npos);
    return outcome.text.substr(begin + mark.size());
  };
  for (const std::string words : {"--sed 3", "--voxel-size wide", "--tone 9", "--background purple", "--seed", "stray",
                                  "--lens mirror", "--calibrate-steps never", "--seed 1 --seed 2"}) {
    INFO(words);
    CHECK(sentence(run(words)) == sentence(testing::tool("train " + scene + words)));
    CHECK_FALSE(fs::exists(at("run")));
  }
  // Of a fitted cell they are those of three commands.
  CHECK(sentence(run("--fit-codec 100 --sed 3")) == sentence(testing::tool("train " + scene + "--sed 3")));
  const std::string embed = "embed --model " + at("one/nothing") + " --key " + at("one/nothing") + " " + scene;
  for (const std::string words : {"--tone 9", "--message-power 0"}) {
    INFO(words);
    CHECK(sentence(run("--fit-codec 100 " + words)) == sentence(testing::tool(embed + words)));
  }
  CHECK(sentence(run("--fit-codec 100 --mark-iterations few")) == sentence(testing::tool(embed + "--iterations few")));
  CHECK(sentence(run("--downscale 2")).find("--downscale: cannot be given") == 0);  // the scene says it
  CHECK_FALSE(fs::exists(at("run")));
}

TEST_CASE("fidelity: options by the names that they had are those of today, in folders of before too") {
  Settings before, today, other;
  before.extra = {"--draw-by-cost", "0.5", "--hold-steps=20"};
  today.extra = {"--sample-by-loss", "0.5", "--calibrate-steps=20"};
  other.extra = {"--sample-by-loss", "0.5", "--calibrate-steps=30"};
  const Cell lego{{"data/lego", "lego", 2}, "hac"};
  CHECK(settings_json(lego, before) != settings_json(lego, today));  // as it was given
  CHECK(same_settings(settings_json(lego, before), settings_json(lego, today)));
  CHECK(same_settings(settings_json(lego, today), settings_json(lego, before)));
  CHECK_FALSE(same_settings(settings_json(lego, before), settings_json(lego, other)));
  CHECK(unmarked_json(lego, before) == unmarked_json(lego, today));  // they are the mark's
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
  // What is said of a step is in its folder, not on the terminal.
  CHECK(times_in(text_of(at("run/keygen.txt")), "key id ") == 1);
  CHECK(times_in(text_of(at("run/one_hac/train.txt")), "\nsha256 ") == 2);  // of the unmarked and the marked model
  CHECK(times_in(text_of(at("run/one_hac/evaluate.txt")), "PSNR") > 0);
  CHECK(times_in(outcome.text, "sha256 ") == 0);
  // The marked one against the unmarked one on its side of the codec.
  CHECK(row["marked_before"]["psnr_vs_unmarked"].get<double>() ==
        doctest::Approx(json_of(at("run/one_hac/results.json"))["psnr_marked_vs_unmarked"].get<double>()));
  CHECK(row["marked_after"]["psnr_vs_unmarked"].get<double>() ==
        doctest::Approx(results["psnr_marked_vs_unmarked"].get<double>()));

  const fs::file_time_type trained = fs::last_write_time(at("run/one_hac/model.cmk"));
  fs::remove(at("run/one_hac/evaluate.json"));
  const Outcome measured = run(command + "200 --compmark " + at("no_such_tool"));
  CHECK(measured.code == 0);
  CHECK(times_in(measured.text, "warning: --compmark is not used") == 1);
  CHECK(fs::last_write_time(at("run/one_hac/model.cmk")) == trained);
  CHECK(fs::exists(at("run/one_hac/evaluate.json")));
  CHECK(run(command + "300").code == 1);          // other settings in this folder
  CHECK(run(command + "200 --sed 3").code == 2);  // wrong words are seen in a run that has nothing left to do too
  CHECK(run(command + "200 --decoder x").code == 2);
  CHECK(run(command + "200 --decoder=x").code == 2);
  CHECK(run(command + "twice").code == 2);
  CHECK(run(command + "200 --resume").code == 0);  // it always does
  CHECK(fs::last_write_time(at("run/one_hac/model.cmk")) == trained);
  // With another key nothing is run, and nothing written.
  const std::string table = text_of(at("run/fidelity.json"));
  fs::rename(at("run/owner.key"), at("kept.key"));
  REQUIRE(write_key(at("run/owner.key"), testing::fixed_key(1, 16)).ok());
  const Outcome replaced = run(command + "200");
  INFO(replaced.text);
  CHECK(replaced.code == 2);
  CHECK(replaced.text.find("put that key back") != std::string::npos);
  CHECK(text_of(at("run/fidelity.json")) == table);
  fs::rename(at("kept.key"), at("run/owner.key"));
  CHECK(run(command + "200").code == 0);

  // A run that is stopped, in the training and in the marking, and gone on with by the same command is this one to the bit.
  fs::create_directories(at("stopped"));
  fs::copy_file(at("run/owner.key"), at("stopped/owner.key"));
  const std::string again = command.substr(0, command.find(" --out ")) + " --out " + at("stopped") +
                            command.substr(command.find(" --codecs ")) + "200";
  for (const char* part : {"unmarked/", ""}) {
    const std::string cell = at("stopped/one_hac/") + part;
    INFO(cell);
    const Outcome stop = stopped_at(cell + "log.jsonl", again);
    INFO(stop.text);
    REQUIRE(stop.text.find("ended with 130") != std::string::npos);
    CHECK(fs::exists(cell + "checkpoint.safetensors"));
    CHECK_FALSE(fs::exists(at("stopped/fidelity.json")));
  }
  REQUIRE(run(again).code == 0);
  for (const char* results_of : {"one_hac/unmarked/results.json", "one_hac/results.json"}) {
    CHECK(json_of(at("stopped/") + results_of)["model_sha256"] == json_of(at("run/") + results_of)["model_sha256"]);
    CHECK(json_of(at("stopped/") + results_of)["iterations"] == json_of(at("run/") + results_of)["iterations"]);
  }
  for (const char* file : {"one_hac/model.cmk", "one_hac/unmarked.cmk", "one_hac/decoder.safetensors"})
    CHECK(testing::file_bytes(at("stopped/") + file) == testing::file_bytes(at("run/") + file));
  nlohmann::json whole = nlohmann::json::parse(table), stopped = json_of(at("stopped/fidelity.json"));
  for (nlohmann::json* each : {&whole, &stopped}) (*each)["rows"][0].erase("seconds");
  CHECK(stopped == whole);

  CHECK(run("--data " + at("scenes/empty") + " --out " + at("nothing")).code == 2);
  CHECK(run("--data " + at("scenes/one@half") + " --out " + at("nothing")).code == 2);
  CHECK_FALSE(fs::exists(at("nothing")));
}

TEST_CASE("fidelity: words go to the run of a fitted cell that takes them") {
  const DividedWords words =
      divide({"--voxel-size", "0.2", "--fidelity", "50", "--seed=3", "--mark-iterations=100", "--message-rate", "0.01",
              "--checkpoint-every", "9", "--effects", "none", "--period=0.2", "--tone", "0.01"});
  using Words = std::vector<std::string>;
  CHECK(words.train == Words{"--voxel-size", "0.2", "--seed=3", "--checkpoint-every", "9", "--effects", "none"});
  CHECK(words.codec == Words{"--seed=3", "--checkpoint-every", "9"});
  CHECK(words.mark == Words{"--fidelity", "50", "--seed=3", "--iterations=100", "--message-rate", "0.01",
                            "--checkpoint-every", "9", "--period=0.2", "--tone", "0.01"});
  CHECK(divide({"--mark-iterations"}).mark == Words{"--iterations"});  // which embed refuses
  // HAC has no ancestors, and embed would refuse to hold its steps.
  const Words held = {"--calibrate-steps", "9", "--calibrate-steps=8", "--fidelity", "50"};
  CHECK(words_for("hac", held) == Words{"--fidelity", "50"});
  CHECK(words_for("context_gs", held) == held);
}

TEST_CASE("fidelity: both codecs are fitted to one unmarked model, which stays what it was") {
  const ScratchFolder scratch("compmark-fidelity-fitted-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 64 --height 64 --train 12 --test 3");
  // A key that is there is taken; one that takes its time would take a third of this.
  fs::create_directories(at("run"));
  REQUIRE(write_key(at("run/owner.key"), testing::fixed_key(1, 16)).ok());
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
  const double unmarked_seconds = json_of(at("run/one_host/results.json"))["train_seconds"].get<double>();
  for (const nlohmann::json& row : table["rows"]) {
    const std::string folder = "run/one_" + row["codec"].get<std::string>();
    CHECK(json_of(at(folder + "/unmarked/results.json"))["recipe"].get<std::string>().find("+fitted") !=
          std::string::npos);
    CHECK(row["marked_after"]["bytes"] == json_of(at(folder + "/results.json"))["compressed"]["bytes"]);
    CHECK(row["marked_after"]["bit_accuracy"]["mean"].get<double>() >
          row["unmarked_after"]["bit_accuracy"]["mean"].get<double>());
    CHECK(row["seconds"]["train"].get<double>() > unmarked_seconds);
  }
  const fs::file_time_type trained = fs::last_write_time(at("run/one_host/model.safetensors"));
  fs::remove(at("run/one_hac/results.json"));  // as if its embedding had been stopped at the end
  CHECK(run(command + "100").code == 0);
  CHECK(fs::last_write_time(at("run/one_host/model.safetensors")) == trained);
  CHECK(run(command + "120").code == 1);  // another table
  CHECK(run(command + "0").code == 1);
  CHECK(run(command + "-1").code == 2);
}

TEST_CASE("fidelity: who stops it stops the training, which writes its checkpoint first, or the fit at once") {
  const ScratchFolder scratch("compmark-fidelity-stop-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 64 --height 64 --train 12 --test 3");
  const Outcome outcome =
      stopped_at(at("run/one_hac/unmarked/log.jsonl"),
                 "--codecs hac --voxel-size 0 --iterations 100000 --data " + at("one") + " --out " + at("run"));
  INFO(outcome.text);
  CHECK(outcome.text.find("ended with 130") != std::string::npos);
  CHECK(times_in(outcome.text, "the same command goes on") == 1);
  CHECK(times_in(outcome.text, "interrupted after iteration") == 1);
  CHECK(fs::exists(at("run/one_hac/unmarked/checkpoint.safetensors")));
  CHECK_FALSE(fs::exists(at("run/fidelity.json")));

  // While a decoder is fitted nothing can be kept: the end comes at once, with the same words and code.
  const std::string said = at("said.txt");
  const Outcome fitting = run_tool(
      "sh", "-c '\"$0\" --codecs hac --voxel-size 0 --iterations 30 --data " + at("one") + " --out " + at("fit") +
                " 2> " + said + " & pid=$!; while ! grep -q \"novel views\" " + said +
                "; do kill -0 $pid || exit 9; sleep 0.02; done; kill -INT $pid; wait $pid; echo ended with $?' \"" +
                COMPMARK_REPRODUCE_FIDELITY + "\"");
  INFO(fitting.text);
  CHECK(fitting.text.find("ended with 130") != std::string::npos);
  CHECK(times_in(text_of(said), "the same command goes on") == 1);
  CHECK(fs::exists(at("fit/one_hac/unmarked/results.json")));
  CHECK_FALSE(fs::exists(at("fit/one_hac/decoder.safetensors")));
}

}  // namespace fidelity_test
