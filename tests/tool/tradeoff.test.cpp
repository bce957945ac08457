// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Accuracy against time, whole: which points are on the front, what the page says of them, and that the program runs each training once. Its runs are
// those of the presets, hours long; here a script stands for the tool and writes files as a finished run does. What the tool itself writes into a cell
// is the fidelity table's test.
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
  return one;
}

/// Says what it is asked to a file, trains in no time a host where there is none, and writes what tradeoff reads. A longer training is a better one.
constexpr const char* stand_in = R"(#!/bin/sh
set -e
command=$1; shift
out='' iterations='' json='' key='' words="$*"
while [ $# -gt 0 ]; do
  case $1 in --out) out=$2 ;; --iterations) iterations=$2 ;; --json) json=$2 ;; esac
  shift
done
log=$(dirname "$0")/log.txt
case $command in
  keygen) cp "$(dirname "$0")/made.key" "$out" ;;
  train)
    if [ -d "$out/unmarked" ]; then echo "marked $words" >> "$log"; else
      echo "trained $words" >> "$log"
      mkdir -p "$out/unmarked"
      echo "{\"train_seconds\": $iterations}" > "$out/unmarked/results.json"
      echo host > "$out/unmarked/model.safetensors"
      echo decoder > "$out/decoder.safetensors"
      echo '{"seconds": 10}' > "$out/decoder.json"
    fi
    echo '{"train_seconds": 20}' > "$out/results.json" ;;
  evaluate)
    seconds=$(sed 's/[^0-9]//g' "$(dirname "$json")/unmarked/results.json")
    model="{\"psnr\": $seconds, \"ssim\": 0.9, \"bytes\": 1000, \"bit_accuracy\": {\"mean\": 0.99, \"min\": 0.9, \"views\": 3}, \"p_value\": 1e-9, \"largest_view_p_value\": 1e-7}"
    echo "{\"models\": [$model, $model, $model, $model]}" > "$json" ;;
esac
)";

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

TEST_CASE("tradeoff: a point is on the front where none is as good in all four and better in one") {
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
  const tool::Table table = price_table(points);
  for (const auto& line : table.rows) CHECK(line.size() == table.columns.size());
  CHECK(price_plots(points).size() == 3);
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
  REQUIRE(write_file(at("tool"), std::string(stand_in)).ok());
  REQUIRE(write_key(at("made.key"), testing::fixed_key(1, 48)).ok());
  std::filesystem::permissions(at("tool"), std::filesystem::perms::owner_all);
  const auto run = [&](const std::string& arguments) {
    return run_tool(COMPMARK_TRADEOFF,
                    "--data " + at("one") + " --out " + at("run") + " --compmark " + at("tool") + " " + arguments);
  };
  const Outcome first = run("--points draft_hac standard_hac standard_marked_longer_hac --seed 3");
  INFO(first.text);
  REQUIRE(first.code == 0);
  std::string log = text_of(scratch.path / "log.txt");
  CHECK(times_in(log, "trained ") == 2);
  CHECK(times_in(log, "marked --data") == 1);  // with the host that is there
  CHECK(times_in(log, "--seed 3") == 3);
  CHECK(times_in(log, "--mark-iterations 8000") == 1);
  CHECK(text_of(at("run/standard_marked_longer_hac/decoder.safetensors")) == "decoder\n");
  nlohmann::json json = json_of(at("run/tradeoff.json"));
  REQUIRE(json["points"].size() == 3);
  CHECK(json["points"][1]["name"] == "standard_hac");
  CHECK(json["points"][1]["seconds"]["train"] == 10000);
  CHECK(json["points"][1]["psnr"] == 10000);
  for (const char* file : {"tradeoff.md", "tradeoff.html"})
    CHECK(times_in(text_of(scratch.path / "run" / file), "standard_hac") > 0);
  CHECK(times_in(text_of(at("run/tradeoff.svg")), "<title>marked longer, HAC</title>") == 3);  // in three plots
  CHECK(json["scene"] == "one");
  CHECK(json["train"] == nlohmann::json({"--seed", "3"}));

  // One more, beside those of the earlier command, of which one is asked for again.
  REQUIRE(run("--points best_hac standard_hac --seed 3").code == 0);
  log = text_of(scratch.path / "log.txt");
  CHECK(times_in(log, "trained ") == 3);
  CHECK(times_in(log, "marked --data") == 1);
  json = json_of(at("run/tradeoff.json"));
  CHECK(json["points"].size() == 4);
  CHECK(json["points"][2]["pareto"] == true);

  // A host is found wherever in the list it was trained, one of other settings is not.
  REQUIRE(run("--points draft_context_gs --seed 4").code == 0);
  fs::remove_all(at("run/standard_hac"));
  REQUIRE(run("--points standard_hac --seed 3").code == 0);
  log = text_of(scratch.path / "log.txt");
  CHECK(times_in(log, "trained ") == 4);
  CHECK(times_in(log, "marked --data") == 2);
  CHECK(run("--points draft_hac --seed 4").code == 1);  // another's folder
  CHECK(json_of(at("run/tradeoff.json"))["points"].size() == 4);

  CHECK(run("--points fastest").code == 2);
  for (const char* own : {"--lambda 0.01", "--mark-iterations 10", "--fidelity=1", "--preset best"})
    CHECK(run(own).code == 2);
  CHECK(run("--key mine").code == 2);
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
