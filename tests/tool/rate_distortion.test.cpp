// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Rate-distortion curves: what is said of them, and the program itself, on a scene of seconds.
#include <doctest/doctest.h>

#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "fidelity/curve_run.hpp"
#include "fidelity/curves.hpp"
#include "tool/running.hpp"

namespace rate_distortion_test {

namespace {

using namespace fidelity;
using compmark::testing::done;
using compmark::testing::json_of;
using compmark::testing::Outcome;
using compmark::testing::run_tool;
using compmark::testing::ScratchFolder;
using compmark::testing::text_of;
using compmark::testing::times_in;

CurvePoint made(const char* scene, const char* codec, double lambda, double psnr, double bytes) {
  CurvePoint point;
  point.scene.name = scene;
  point.codec = codec;
  point.lambda = lambda;
  point.psnr = psnr;
  point.ssim = psnr / 40;
  point.bytes = bytes;
  return point;
}

}  // namespace

TEST_CASE("rate_distortion: codecs are compared scene by scene, and where they cannot be it is said why") {
  const std::vector<CurvePoint> points = {
      made("chair", "hac", .004, 33, 300e3),        made("chair", "hac", .001, 36, 500e3),
      made("chair", "context_gs", .004, 33, 240e3), made("chair", "context_gs", .001, 36, 400e3),
      made("cup", "hac", .004, 28, 300e3),          made("cup", "hac", .001, 29, 500e3),
      made("cup", "context_gs", .004, 29.5, 300e3), made("cup", "context_gs", .001, 30, 500e3)};
  const std::vector<std::string> codecs = {"hac", "context_gs"};
  const std::vector<CurveDelta> deltas = curve_deltas(points, codecs);
  REQUIRE(deltas.size() == 2);
  CHECK(deltas[0].scene == "chair");
  CHECK(deltas[0].tested == "context_gs");
  REQUIRE((deltas[0].rate_psnr && deltas[0].psnr && deltas[0].rate_ssim));
  CHECK(deltas[0].rate_psnr->delta == doctest::Approx(-0.2));
  CHECK(deltas[0].rate_ssim->delta == doctest::Approx(-0.2));
  CHECK(deltas[0].psnr->delta > 0);
  CHECK_FALSE(deltas[1].rate_psnr);  // better everywhere: at no quality both
  CHECK(deltas[1].psnr->delta == doctest::Approx(1.25));
  CHECK(deltas[1].problem.find("BD-rate (PSNR): ") == 0);
  CHECK(deltas[1].problem.find("no quality in common") != std::string::npos);
  const tool::Table table = delta_table(deltas), all = curve_table(points);
  for (const auto& row : table.rows) CHECK(row.size() == table.columns.size());
  for (const auto& row : all.rows) CHECK(row.size() == all.columns.size());
  CHECK(curve_plots(points, codecs).size() == 4);
  const nlohmann::ordered_json json = curve_json(Settings{}, points, codecs);
  CHECK(json["bd"][0]["bd_rate_psnr"]["from"] == 33);
  CHECK_FALSE(json["bd"][1].contains("bd_rate_psnr"));
  CHECK(curve_deltas({points[0], points[1]}, {"hac"}).empty());

  // Of the first scene the first codec is missing: it is the reference all the same, and the colours stay.
  const std::vector<CurvePoint> partial(points.begin() + 2, points.end());
  const std::vector<CurveDelta> rest = curve_deltas(partial, codecs);
  REQUIRE(rest.size() == 2);
  CHECK(rest[0].reference == "hac");
  CHECK(rest[0].problem.find("reference curve") != std::string::npos);
  CHECK(rest[1].psnr->delta == doctest::Approx(1.25));
  const std::vector<tool::Plot> plots = curve_plots(partial, codecs);
  REQUIRE(plots[0].series.size() == 1);
  CHECK(plots[0].series[0].color == 1);
}

TEST_CASE("rate_distortion: every two codecs are compared, the later one against the earlier") {
  std::vector<CurvePoint> points;
  for (const auto& [codec, share] : {std::pair("hac", 1.0), std::pair("context_gs", 0.8), std::pair("hac_plus", 0.9)}) {
    for (const auto& [psnr, bytes] : {std::pair(33.0, 300e3), std::pair(34.5, 380e3), std::pair(36.0, 500e3)})
      points.push_back(made("chair", codec, 0.001, psnr, share * bytes));
  }
  const auto rate_of = [&](const std::vector<std::string>& codecs, std::size_t i) {
    const std::vector<CurveDelta> deltas = curve_deltas(points, codecs);
    REQUIRE(deltas.size() == codecs.size() * (codecs.size() - 1) / 2);
    REQUIRE(deltas[i].rate_psnr);
    return deltas[i].rate_psnr->delta;
  };
  const std::vector<std::string> all = {"hac", "context_gs", "hac_plus"};
  CHECK(rate_of(all, 0) == doctest::Approx(-0.2));
  CHECK(rate_of(all, 1) == doctest::Approx(-0.1));
  CHECK(rate_of(all, 2) == doctest::Approx(0.9 / 0.8 - 1));
  const std::vector<CurveDelta> deltas = curve_deltas(points, all);
  CHECK(deltas[1].reference == "hac");
  CHECK(deltas[1].tested == "hac_plus");
  CHECK(deltas[2].reference == "context_gs");
  CHECK(delta_table(deltas).rows[2][0] == "chair: hac_plus against context_gs");
  // The other way round it is 1 / (1 + delta) - 1.
  CHECK(rate_of({"hac_plus", "context_gs"}, 0) == doctest::Approx(0.8 / 0.9 - 1));
  CHECK(curve_plots(points, all)[0].series.size() == 3);
}

TEST_CASE("rate_distortion: points that another of their codec beats are left out of the comparison, and named") {
  // Of a capture whose quality no byte improves past some point: the curve of all points falls, and has no Bjontegaard delta.
  const std::vector<CurvePoint> points = {
      made("cup", "hac", .0005, 29.42, 1400e3),      made("cup", "hac", .001, 29.43, 1200e3),
      made("cup", "hac", .002, 29.43, 960e3),        made("cup", "hac", .004, 29.1, 780e3),
      made("cup", "context_gs", .002, 29.43, 864e3), made("cup", "context_gs", .004, 29.1, 702e3)};
  const std::vector<CurveDelta> deltas = curve_deltas(points, {"hac", "context_gs"});
  REQUIRE(deltas.size() == 1);
  REQUIRE(deltas[0].rate_psnr);
  CHECK(deltas[0].rate_psnr->delta == doctest::Approx(-0.1));
  CHECK(deltas[0].rate_psnr->from == 29.1);
  CHECK(deltas[0].rate_psnr->to == 29.43);
  REQUIRE(deltas[0].beaten.size() == 4);  // two of PSNR, two of SSIM
  CHECK(deltas[0].beaten[0] == "hac 0.001 by 0.002 (PSNR)");
  CHECK(deltas[0].beaten[1] == "hac 0.0005 by 0.002 (PSNR)");
  CHECK(deltas[0].problem.empty());
  CHECK(curve_json(Settings{}, points, {"hac", "context_gs"})["bd"][0]["beaten"].size() == 4);
  CHECK(curve_plots(points, {"hac"})[0].series[0].points.size() == 4);  // seen all the same
  // The control: all of them.
  std::vector<compmark::RatePoint> all;
  for (std::size_t i = 0; i < 4; ++i) all.push_back({points[i].bytes, points[i].psnr});
  CHECK_FALSE(compmark::bd_rate(all, all));
}

TEST_CASE("rate_distortion: every point is trained once, a smaller lambda makes a larger file, and the page has all") {
  const ScratchFolder scratch("compmark-rate-distortion-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  done("scene --out " + at("one") + " --width 48 --height 40 --train 6 --test 2");
  const auto run = [&](const std::string& arguments) {
    return run_tool(COMPMARK_RATE_DISTORTION,
                    "--data " + at("one") + " --out " + at("run") + " --effects none --voxel-size 0.2 " + arguments);
  };
  const Outcome first = run("--iterations 200 --codecs hac --lambdas 0.05 0.001");
  INFO(first.text);
  REQUIRE(first.code == 0);
  nlohmann::json json = json_of(at("run/rate_distortion.json"));
  REQUIRE(json["points"].size() == 2);
  const auto point = [&](std::size_t i) { return json["points"][i]; };
  CHECK(point(0)["lambda"] == 0.05);
  CHECK(point(0)["bytes"].get<double>() < point(1)["bytes"].get<double>());
  CHECK(point(0)["bytes"].get<double>() == static_cast<double>(fs::file_size(at("run/one_hac_0.05/model.cmk"))));
  CHECK(point(0)["views"] == 2);
  CHECK(json["train"] == nlohmann::json({"--effects", "none", "--voxel-size", "0.2"}));
  CHECK(json["bd"].empty());

  // One more codec: the points of the first are found again.
  const auto written = fs::last_write_time(at("run/one_hac_0.05/results.json"));
  const Outcome second = run("--iterations 200 --lambdas 0.05 0.001 --codecs hac context_gs");
  INFO(second.text);
  REQUIRE(second.code == 0);
  CHECK(fs::last_write_time(at("run/one_hac_0.05/results.json")) == written);
  json = json_of(at("run/rate_distortion.json"));
  REQUIRE(json["points"].size() == 4);
  CHECK(point(3)["codec"] == "context_gs");
  REQUIRE(json["bd"].size() == 1);
  for (const char* file : {"rate_distortion.md", "rate_distortion.html", "rate_distortion.svg"})
    CHECK(times_in(text_of(scratch.path / "run" / file), "context_gs") > 0);
  CHECK(times_in(second.text, "one_context_gs_0.001: train") == 1);

  // All codecs of the library, as nothing is said: hac_plus is of the trainings that are there.
  const Outcome third = run("--iterations 200 --lambdas 0.05 0.001");
  INFO(third.text);
  REQUIRE(third.code == 0);
  CHECK(times_in(third.text, ": train") == 0);
  CHECK(times_in(third.text, ": compress") == 2);
  json = json_of(at("run/rate_distortion.json"));
  REQUIRE(json["points"].size() == 6);
  REQUIRE(json["bd"].size() == 3);
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
    const nlohmann::json trained = point(i), coded = point(i + 4);
    CHECK(coded["codec"] == "hac_plus");
    for (const char* same : {"lambda", "psnr", "ssim", "psnr_as_trained", "anchors", "views", "train_seconds"})
      CHECK(coded[same] == trained[same]);
    const fs::path folder = at(i == 0 ? "run/one_hac_plus_0.05" : "run/one_hac_plus_0.001");
    CHECK(coded["bytes"].get<double>() == static_cast<double>(fs::file_size(folder / "model.cmk")));
    CHECK(coded["bytes"] != trained["bytes"]);
    CHECK(json_of((folder / "results.json").string())["compressed"]["codec"] == "hac_plus");
    CHECK(coded["decode_seconds"].get<double>() > 0);
    CHECK_FALSE(fs::exists(folder / "decoded.safetensors"));
  }
  CHECK(json["bd"][1]["tested"] == "hac_plus");
  CHECK(times_in(text_of(scratch.path / "run/rate_distortion.md"), "hac_plus against context_gs") == 1);
  CHECK(times_in(run("--iterations 200 --lambdas 0.05 0.001").text, ": compress") == 0);
  // Of a training whose file is another one's the qualities would be another's: refused.
  fs::copy_file(at("run/one_hac_0.001/model.cmk"), at("run/one_hac_0.05/model.cmk"),
                fs::copy_options::overwrite_existing);
  fs::remove(at("run/one_hac_plus_0.05/results.json"));
  const Outcome mixed = run("--iterations 200 --lambdas 0.05 0.001");
  CHECK(mixed.code == 1);
  CHECK(times_in(mixed.text, "decodes to another model than") == 1);
  CHECK(times_in(mixed.text, "not there: one_hac_plus_0.05") == 1);
  CHECK(run("--codecs zip").code == 2);

  // Other settings are another curve: refused in its folder, which stays as it was.
  const Outcome other = run("--iterations 300 --codecs hac --lambdas 0.05");
  CHECK(other.code == 1);
  CHECK(times_in(other.text, "is of other settings") == 1);
  CHECK(times_in(other.text, "not there: one_hac_0.05") == 1);
  CHECK(fs::last_write_time(at("run/one_hac_0.05/results.json")) == written);
  const Outcome single = run("--lambda 0.1");
  CHECK(single.code == 2);
  CHECK(times_in(single.text, "--lambdas") == 1);
  for (const char* word :
       {"--key mine", "--fidelity 3", "--fidelity-fall 1", "--sample-by-loss 1", "--calibrate-steps 9",
        "--message-power 2", "--json-log x.jsonl", "--hold-steps 9", "--sed 3"})
    CHECK(run(word).code == 2);
}

namespace {

/// Trains in no time; not at lambda 0.9, is stopped at 0.8, and says nothing of its file at 0.7. The model's digest is
/// `digest`.
class InstantSteps final : public Steps {
 public:
  Result<Done> check(Step, const Cell&, const Settings&) const override { return Done{}; }
  Result<Done> make_key(const Settings&) const override {
    FAIL("a curve has no key");
    return Done{};
  }
  Result<bool> take(Step step, const Cell& cell, const Settings& settings, const fs::path& folder) const override {
    using nlohmann::json;
    const double lambda = settings.rate_lambda;
    if (step == Step::compress) {
      coded.push_back(lambda);
      json results = json_of((settings.out / curve_name(training_of(cell), settings) / "results.json").string());
      results["compressed"]["bytes"] = 9000 * lambda;
      REQUIRE(compmark::write_json(folder / "results.json", results).ok());
      return true;
    }
    REQUIRE(step == Step::train_coded);
    REQUIRE(cell.codec == "hac");
    lambdas.push_back(lambda);
    if (lambda == 0.9) return Error{ErrorKind::invalid, folder.string(), {}, "cannot be trained", {}};
    REQUIRE(compmark::write_json(folder / "log.jsonl", json::object()).ok());
    if (lambda == 0.8) {
      REQUIRE(compmark::write_file(folder / "checkpoint.safetensors", std::string("x")).ok());
      return false;
    }
    json file = {{"bytes", 10000 * lambda},
                 {"anchors", 5},
                 {"test", {{"psnr", 30 + lambda}, {"ssim", 0.9}, {"views", 2}, {"lpips_alex", nullptr}}}};
    if (lambda == 0.7) file = json::object();
    REQUIRE(compmark::write_json(
                folder / "results.json",
                json{{"train_seconds", 60}, {"test", {{"psnr", 40}}}, {"model_sha256", digest}, {"compressed", file}})
                .ok());
    return true;
  }
  std::string digest = "first";
  mutable std::vector<double> lambdas, coded;
};

}  // namespace

TEST_CASE("rate_distortion: points that fail leave the others, and a stop is gone on from") {
  const ScratchFolder scratch("compmark-rate-distortion-steps-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  const std::vector<std::string> codecs = {"hac"};
  const InstantSteps steps;
  const auto run = [&](const std::vector<double>& lambdas) {
    Settings settings;
    settings.out = at("run");
    return run_curves("rate_distortion", settings, wanted_points(settings, {{at("one"), "one", 1}}, codecs, lambdas),
                      codecs, steps)
        .code;
  };
  CHECK(run({0.1, 0.9, 0.7, 0.2}) == 1);
  nlohmann::json json = json_of(at("run/rate_distortion.json"));
  REQUIRE(json["points"].size() == 2);
  CHECK(json["points"][1]["bytes"] == 2000);
  CHECK(json["points"][1]["psnr_as_trained"] == 40);
  CHECK_FALSE(json["points"][1].contains("lpips_alex"));

  CHECK(run({0.1, 0.8, 0.3}) == 130);
  CHECK_FALSE(fs::exists(at("run/one_hac_0.3")));
  fs::remove(at("run/one_hac_0.8/checkpoint.safetensors"));
  REQUIRE(compmark::write_file(at("run/one_hac_0.8/results.json"), text_of(at("run/one_hac_0.1/results.json"))).ok());
  CHECK(run({0.1, 0.8, 0.3}) == 0);
  CHECK(json_of(at("run/rate_distortion.json"))["points"].size() == 3);
  CHECK(steps.lambdas == std::vector<double>{0.1, 0.9, 0.7, 0.2, 0.8, 0.3});
}

TEST_CASE("rate_distortion: a training is shared by the codecs that code it, whichever comes first") {
  const ScratchFolder scratch("compmark-rate-distortion-shared-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  InstantSteps steps;
  const auto run = [&](const std::vector<std::string>& codecs, const std::vector<double>& lambdas) {
    Settings settings;
    settings.out = at("run");
    steps.lambdas.clear();
    steps.coded.clear();
    return run_curves("rate_distortion", settings, wanted_points(settings, {{at("one"), "one", 1}}, codecs, lambdas),
                      codecs, steps)
        .code;
  };
  using Lambdas = std::vector<double>;
  CHECK(run({"hac_plus"}, {0.1, 0.2}) == 0);  // by itself: it is trained for, and no point of hac is shown
  CHECK(steps.lambdas == Lambdas{0.1, 0.2});
  CHECK(steps.coded == Lambdas{0.1, 0.2});
  CHECK(json_of(at("run/rate_distortion.json"))["points"].size() == 2);
  CHECK(run({"hac_plus", "hac"}, {0.1, 0.2}) == 0);  // what hac needs is there
  CHECK(steps.lambdas.empty());
  CHECK(steps.coded.empty());
  const nlohmann::json json = json_of(at("run/rate_distortion.json"));
  REQUIRE(json["points"].size() == 4);
  CHECK(json["bd"][0]["bd_rate_psnr"]["delta"].get<double>() == doctest::Approx(1 / 0.9 - 1));

  // Trained again to another model: its file is made again, and no other.
  fs::remove_all(at("run/one_hac_0.1"));
  steps.digest = "second";
  CHECK(run({"hac", "hac_plus"}, {0.1, 0.2}) == 0);
  CHECK(steps.lambdas == Lambdas{0.1});
  CHECK(steps.coded == Lambdas{0.1});
  CHECK(json_of(at("run/one_hac_plus_0.1/results.json"))["model_sha256"] == "second");

  CHECK(run({"hac_plus"}, {0.9, 0.3}) == 1);  // what cannot be trained has no file, and the next has one
  CHECK(steps.coded == Lambdas{0.3});
  CHECK_FALSE(fs::exists(at("run/one_hac_plus_0.9")));
  CHECK(run({"hac_plus"}, {0.8}) == 130);
  CHECK(steps.coded.empty());
}

}  // namespace rate_distortion_test
