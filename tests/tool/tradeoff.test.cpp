// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Accuracy against time, whole: which points are on the front, what the page says of them, and that each training is run
// once. The runs are those of the presets, hours long; here steps of the test's own write files as finished runs do.
// What a real step writes into a cell is the fidelity table's test.
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "fidelity/points.hpp"
#include "fidelity/price_run.hpp"
#include "fidelity/run_cell.hpp"
#include "fidelity/steps.hpp"
#include "tool/running.hpp"

namespace tradeoff_test {

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

PricedPoint priced(const char* name, double seconds, double bytes, double psnr, double accuracy) {
  PricedPoint one;
  one.point.name = name;
  one.point.codec = "hac";
  one.row.train_seconds = seconds;
  one.row.models[marked_coded].bytes = bytes;
  one.row.models[marked_coded].psnr = psnr;
  one.row.models[marked_coded].accuracy = accuracy;
  one.row.models[marked_coded].attacked = {{"jpeg:50", 0.9}, {"noise:0.1", 0.8}};
  return one;
}

/// Trains in no time an unmarked model where there is none, and writes what the points are read from. A longer training
/// is a better one.
class InstantSteps final : public Steps {
 public:
  Result<Done> check(Step, const Cell&, const Settings&) const override { return Done{}; }
  Result<Done> make_key(const Settings& settings) const override {
    return write_key(settings.key(), testing::fixed_key(1, 48));
  }
  Result<bool> take(Step step, const Cell&, const Settings& settings, const fs::path& folder) const override {
    using nlohmann::json;
    std::string words;
    for (const std::string& word : settings.extra) words += " " + word;
    if (step == Step::evaluate) {
      const json trained = json_of(folder / "unmarked/results.json");
      json attacks = json::array();
      for (const std::string& attack : settings.attacks)
        attacks.push_back({{"attack", attack}, {"bit_accuracy", {{"mean", attack == "hue:10" ? 0.7 : 0.8}}}});
      const json model = {{"psnr", trained["train_seconds"]},
                          {"ssim", 0.9},
                          {"bytes", 1000},
                          {"bit_accuracy", {{"mean", 0.99}, {"min", 0.9}, {"views", 3}}},
                          {"p_value", 1e-9},
                          {"largest_view_p_value", 1e-7},
                          {"attacks", attacks}};
      REQUIRE(write_json(folder / "evaluate.json", json{{"models", {model, model, model, model}}, {"attacks", attacks}})
                  .ok());
      return true;
    }
    REQUIRE(step == Step::train_marked);
    if (fs::exists(folder / "unmarked")) {
      log += "marked" + words + "\n";
    } else {
      log += "trained" + words + "\n";
      fs::create_directories(folder / "unmarked");
      REQUIRE(write_json(folder / "unmarked/results.json", json{{"train_seconds", settings.iterations}}).ok());
      REQUIRE(write_file(folder / "unmarked/model.safetensors", std::string("model")).ok());
      if (!settings.universal) {
        REQUIRE(write_file(folder / "decoder.safetensors", std::string("decoder\n")).ok());
        REQUIRE(write_json(folder / "decoder.json", json{{"seconds", 10}}).ok());
      }
    }
    REQUIRE(write_json(folder / "results.json", json{{"train_seconds", 20}}).ok());
    return true;
  }
  mutable std::string log;
};

}  // namespace

TEST_CASE("tradeoff: names of near points stand on no other name, and each is in its dot's tooltip") {
  tool::Plot plot{.title = "crowded", .x_label = "x", .y_label = "y", .series = {}};
  tool::PlotSeries series{.label = "", .points = {}, .names = {}, .line = false, .dots = true};
  for (int i = 0; i < 12; ++i) {  // a far one stretches the axes
    series.points.push_back({i == 11 ? 30.0 : 10 + 0.05 * i, i == 11 ? 20.0 : 37 + 0.07 * (i % 4)});
    series.names.push_back("standard number " + std::to_string(i));
  }
  plot.series.push_back(series);
  const std::string drawn = tool::svg(plot);
  struct Box {
    double left, right, top;
  };
  std::vector<Box> boxes;
  const auto number = [&](std::size_t from, const std::string& attribute) {
    return std::stod(drawn.substr(drawn.find(attribute + "=\"", from) + attribute.size() + 2));
  };
  for (const std::string& name : series.names) {
    CHECK(drawn.find("<title>" + name + "</title>") != std::string::npos);
    const std::size_t text = drawn.find("\">" + name + "</text>");
    if (text == std::string::npos) continue;
    const std::size_t begin = drawn.rfind("<text", text);
    const double x = number(begin, "x"), wide = 6.4 * static_cast<double>(name.size());
    const bool end = drawn.substr(begin, text - begin).find("\"end") != std::string::npos;
    boxes.push_back({end ? x - wide : x, end ? x : x + wide, number(begin, "y")});
  }
  const auto meet = [](const Box& a, const Box& b) {
    return a.left < b.right && b.left < a.right && std::abs(a.top - b.top) < 12;
  };
  CHECK(boxes.size() >= 3);  // there is room for some
  for (std::size_t a = 0; a < boxes.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) CHECK_FALSE(meet(boxes[a], boxes[b]));
  }
  // Each beside its own dot they would.
  std::vector<double> x;
  for (std::size_t at = drawn.find("<circle"); at != std::string::npos; at = drawn.find("<circle", at + 1))
    x.push_back(number(at, "cx"));
  REQUIRE(x.size() == 12);
  CHECK(std::abs(x[1] - x[0]) < 6.4 * 17);
}

TEST_CASE("tradeoff: a point is on the front where none is as good in all six and better in one") {
  const std::vector<PricedPoint> points = {
      priced("cheap", 10, 100, 30, .9),     priced("good", 100, 100, 35, .99), priced("dominated", 101, 100, 35, .99),
      priced("small", 200, 50, 30, .9),     priced("same", 10, 100, 30, .9),   priced("readable", 300, 200, 20, 1.0),
      priced("hopeless", 400, 300, 10, .5),
  };
  std::vector<std::string> front;
  for (const PricedPoint& one : points) {
    if (on_front(one, points)) front.push_back(one.point.name);
  }
  // Equals do not exclude each other.
  CHECK(front == std::vector<std::string>{"cheap", "good", "small", "same", "readable"});
  CHECK(beaten_by(points[2], points) == "good_hac");
  CHECK(beaten_by(points[1], points).empty());
  CHECK(points[0].worst_edit()->first == "noise:0.1");
  // What survives an edit counts by itself.
  std::vector<PricedPoint> sturdy = points;
  sturdy[2].row.models[marked_coded].attacked[0].second = 0.95;
  CHECK(beaten_by(sturdy[2], sturdy).empty());
  const tool::Table table = price_table(points);
  for (const auto& line : table.rows) CHECK(line.size() == table.columns.size());
  CHECK(price_plots(points).size() == 4);
}

TEST_CASE("tradeoff: the presets have points with both codecs, and every point a name of its own") {
  const std::vector<Point> points = all_points();
  for (const tool::Preset& preset : tool::presets) {
    for (const char* codec : {"hac", "context_gs"}) {
      std::size_t found = 0;
      for (const Point& point : points) {
        if (point.label() == std::string(preset.name) + "_" + codec && point.iterations == preset.iterations) ++found;
      }
      CHECK(found == 1);
    }
  }
  for (const Point& point : points) {
    std::size_t same = 0;
    for (const Point& other : points) same += other.label() == point.label() ? 1 : 0;
    CHECK(same == 1);
  }
}

TEST_CASE("tradeoff: points that differ in the mark share a training, and what is finished is not run again") {
  const ScratchFolder scratch("compmark-tradeoff-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 32 --height 32 --train 4 --test 2");
  const InstantSteps steps;
  const auto run = [&](const std::vector<std::string>& chosen, const char* seed) {
    Settings settings;
    settings.out = at("run");
    settings.extra = {"--seed", seed};
    REQUIRE(open_run(settings, steps).ok());
    return run_points("tradeoff", settings, {at("one"), "one", 1}, chosen, steps).code;
  };
  REQUIRE(run({"draft_hac", "standard_hac", "standard_marked_longer_hac"}, "3") == 0);
  CHECK(times_in(steps.log, "trained ") == 2);
  CHECK(times_in(steps.log, "marked ") == 1);  // with the unmarked model that is there
  CHECK(times_in(steps.log, "--seed 3") == 3);
  CHECK(times_in(steps.log, "--mark-iterations 8000") == 1);
  CHECK_FALSE(fs::exists(at("run/standard_marked_longer_hac/decoder.safetensors")));  // the decoder for every scene
  nlohmann::json json = json_of(at("run/tradeoff.json"));
  REQUIRE(json["points"].size() == 3);
  CHECK(json["points"][1]["name"] == "standard_hac");
  CHECK(json["points"][1]["seconds"]["train"] == 10000);
  CHECK(json["points"][1]["psnr"] == 10000);
  for (const char* file : {"tradeoff.md", "tradeoff.html"})
    CHECK(times_in(text_of(scratch.path / "run" / file), "standard_hac") > 0);
  CHECK(times_in(text_of(at("run/tradeoff.svg")), "<title>marked longer, HAC</title>") == 4);  // in four plots
  CHECK(json["points"][1]["attacked"]["jpeg:50"] == 0.8);
  CHECK(json["points"][1]["decoder"] == "universal");
  CHECK(json["points"][1]["attacked"]["hue:10"] == 0.7);
  CHECK(times_in(text_of(at("run/tradeoff.md")), "| hue:10 ") == 3);  // the worst edit of each
  CHECK(json["scene"] == "one");
  CHECK(json["train"] == nlohmann::json({"--seed", "3"}));

  // One more, beside those of the earlier command, of which one is asked for again.
  REQUIRE(run({"best_hac", "standard_hac"}, "3") == 0);
  CHECK(times_in(steps.log, "trained ") == 3);
  CHECK(times_in(steps.log, "marked ") == 1);
  json = json_of(at("run/tradeoff.json"));
  CHECK(json["points"].size() == 4);
  CHECK(json["points"][2]["pareto"] == true);

  // A point with a decoder of its own is trained by itself, and has it.
  REQUIRE(run({"standard_fit_hac"}, "3") == 0);
  CHECK(times_in(steps.log, "trained ") == 4);
  CHECK(text_of(at("run/standard_fit_hac/decoder.safetensors")) == "decoder\n");
  CHECK(json_of(at("run/tradeoff.json"))["points"].size() == 5);

  // An unmarked model is found wherever in the list it was trained, one of other settings is not.
  REQUIRE(run({"draft_context_gs"}, "4") == 0);
  fs::remove_all(at("run/standard_hac"));
  REQUIRE(run({"standard_hac"}, "3") == 0);
  CHECK(times_in(steps.log, "trained ") == 5);
  CHECK(times_in(steps.log, "marked ") == 2);
  CHECK(run({"draft_hac"}, "4") == 1);  // another's folder
  CHECK(json_of(at("run/tradeoff.json"))["points"].size() == 5);

  const auto refused = [&](const std::string& words) {
    const Outcome outcome = run_tool(COMPMARK_TRADEOFF, "--data " + at("one") + " --out " + at("none") + " " + words);
    INFO(outcome.text);
    CHECK(outcome.code == 2);
    CHECK_FALSE(fs::exists(at("none")));
  };
  for (const char* words : {"--points fastest", "--lambda 0.01", "--mark-iterations 10", "--fidelity=1",
                            "--preset best", "--key mine", "--sed 3", "--tone 9"})
    refused(words);
  const Outcome listed = run_tool(COMPMARK_TRADEOFF, "--list");
  CHECK(listed.code == 0);
  CHECK(times_in(listed.text, "_context_gs\n") == 3);
}

TEST_CASE("tradeoff: a preset says lambda where it was not given, and gives way where it or the iterations were") {
  const ScratchFolder scratch("compmark-preset-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 32 --height 32 --train 4 --test 2");
  const std::string train = "train --data " + at("one") + " --voxel-size 0 --codec hac --out ";
  done(train + at("draft") + " --preset draft --iterations 30");
  const nlohmann::json results = json_of(at("draft/results.json"));
  CHECK(results["iterations"] == 30);
  CHECK(results["rate_lambda"] == 0.004);
  done(train + at("best") + " --preset draft --iterations 30 --lambda 0.003");
  CHECK(json_of(at("best/results.json"))["rate_lambda"] == 0.003);
  CHECK(testing::tool(train + at("none") + " --preset fastest").code == 2);
}

}  // namespace tradeoff_test
