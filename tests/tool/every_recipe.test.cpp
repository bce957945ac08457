// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is trained can be marked, whatever its effects are, and compressed, or it is said why not.
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tool/running.hpp"

namespace every_recipe_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::block;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::tool;

std::string at(const std::string& name) {
  static const testing::ScratchFolder folder("compmark-every-recipe-test");
  return (folder.path / name).string();
}
/// The built-in scene, small, a key, and a decoder that costs nothing.
struct Files {
  std::string scene = at("scene"), key = at("owner.key"), decoder = at("colours.safetensors");
  Files() {
    done("scene --out " + scene + " --width 96 --height 80 --train 12 --test 4");
    REQUIRE(write_key(key, testing::fixed_key(1, 24)).ok());
    REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_colours(24), "a test", fs::path(decoder)).ok());
  }
};
const Files& files() {
  static const Files instance;
  return instance;
}
std::string trained(const std::string& recipe, int iterations = 30) {
  const std::string out = at(recipe), model = out + "/model.safetensors";
  if (!fs::exists(model))
    done("train --recipe " + recipe + " --voxel-size 0.2 --iterations " + std::to_string(iterations) + " --data " +
         files().scene + " --out " + out);
  return model;
}
std::string embed(const std::string& model) {
  return "embed --iterations 3 --model " + model + " --data " + files().scene + " --key " + files().key;
}

}  // namespace

TEST_CASE("tool/every_recipe: a finished model of every recipe carries a message, in its features alone") {
  const std::vector<std::pair<std::string, std::string>> recipes = {
      {"scaffold+antialiasing", "scaffold+antialiasing"},
      {"scaffold+antialiasing+mask", "scaffold+antialiasing+mask"},
      {"scaffold+lens", "scaffold+lens"},
      {"scaffold+fisheye", "scaffold+fisheye"},
      {"scaffold+farfield", "scaffold+farfield"},
      {"scaffold+exposure+farfield", "scaffold+farfield"},
      {"scaffold+exposure+mask", "scaffold+mask"}};
  for (const auto& [recipe, marked_as] : recipes) {
    const std::string& name = recipe;
    CAPTURE(name);
    const std::string model = trained(name), out = at(name + "-marked");
    done(embed(model) + " --decoder " + files().decoder + " --out " + out);
    CHECK(json_of(out + "/results.json")["recipe"] == marked_as);
    const std::string marked = out + "/model.safetensors";
    for (const char* same : {"anchor.position", "anchor.offset", "mlp_color.0.weight"})
      CHECK(block(model, same) == block(marked, same));
    CHECK(block(model, "anchor.feature") != block(marked, "anchor.feature"));
    done("extract --model " + marked + " --decoder " + files().decoder);
  }
}

TEST_CASE("tool/every_recipe: what a recipe cannot have is said before an iteration, with what can be done") {
  const std::string filtered = trained("scaffold+antialiasing");
  // In the loss of the photographs a message trains together with three recipes.
  check_refused(tool(embed(filtered) + " --decoder " + files().decoder + " --fidelity 0 --out " + at("none")),
                {"scaffold+antialiasing", "finished models of every recipe"});
  check_refused(tool(embed(filtered) + " --decoder fit --out " + at("none")), {"--decoder", "leave --decoder out"});
  check_refused(tool("fit --model " + filtered + " --data " + files().scene + " --out " + at("none.safetensors")),
                {"scaffold+antialiasing", "decoder of the program"});
  check_refused(
      tool("fit-codec --model " + trained("scaffold+lens") + " --data " + files().scene + " --out " + at("none")),
      {"scaffold+lens", "--lens undistort"});
  // Photographs are looked at where they are what renders are to be.
  check_refused(tool(embed(trained("scaffold+exposure+farfield")) + " --decoder " + files().decoder +
                     " --photographs 0.3 --out " + at("none")),
                {"--photographs", "scaffold+exposure+farfield"});
  CHECK_FALSE(fs::exists(at("none")));
  const std::string short_run = "train --iterations 1 --voxel-size 0.2 --data " + files().scene;
  const std::string said = "no codec compresses it";
  CHECK(done(short_run + " --effects anti_aliasing --out " + at("noted")).text.find(said) != std::string::npos);
  CHECK(done(short_run + " --effects far_field --out " + at("not-noted")).text.find(said) == std::string::npos);
  const testing::Outcome coded = tool(
      "train --codec hac --effects far_field,exposure --voxel-size 0.2 "
      "--iterations 20 --data " +
      files().scene + " --out " + at("coded"));
  INFO(coded.text);
  REQUIRE(coded.code == 0);
  CHECK(coded.text.find("far_field is left out") != std::string::npos);
  CHECK(coded.text.find("fit-codec compresses") != std::string::npos);
}

TEST_CASE("tool/every_recipe: train --key keeps the effects of the capture, and a message in its training does not") {
  const std::string run = "train --effects far_field,exposure --voxel-size 0.2 --iterations 20 --data " +
                          files().scene + " --key " + files().key + " --decoder " + files().decoder + " --out ";
  const testing::Outcome kept = done(run + at("kept") + " --fidelity 300 --mark-iterations 3");
  CHECK(kept.text.find("is left out") == std::string::npos);
  CHECK(json_of(at("kept/unmarked/results.json"))["recipe"] == "scaffold+exposure+farfield");
  CHECK(json_of(at("kept/results.json"))["recipe"] == "scaffold+farfield");
  const testing::Outcome beside = done(run + at("beside"));
  CHECK(beside.text.find("far_field is left out: no message trains together with it") != std::string::npos);
  CHECK(json_of(at("beside/results.json"))["recipe"] == "scaffold");
}

TEST_CASE("tool/every_recipe: exposures and masks train together for a codec, and the file of the model is marked") {
  for (const std::string codec : {"hac", "context_gs"}) {
    CAPTURE(codec);
    const std::string model = trained(codec + "+exposure+mask"), out = at(codec + "-marked");
    CHECK(fs::exists(fs::path(model).parent_path() / "model.cmk"));
    done(embed(model) + " --decoder " + files().decoder + " --out " + out);
    CHECK(json_of(out + "/results.json")["recipe"] == codec + "+mask");
    done("extract --model " + out + "/model.cmk --decoder " + files().decoder);
  }
}

TEST_CASE("tool/every_recipe: a codec is fitted to far fields and to anchors off its grid, which look as before") {
  const std::vector<std::pair<std::string, std::string>> recipes = {
      {"scaffold+farfield", "hac+fitted"},
      {"scaffold+exposure+farfield", "hac+fitted+exposure"},
      {"scaffold+exposure+mask", "hac+fitted+exposure+mask"}};
  for (const auto& [recipe, fitted] : recipes) {
    const std::string& name = recipe;
    CAPTURE(name);
    const std::string out = at(name + "-fitted");
    done("fit-codec --iterations 10 --model " + trained(recipe) + " --data " + files().scene + " --out " + out);
    CHECK(json_of(out + "/results.json")["recipe"] == fitted);
    CHECK(fs::exists(out + "/model.cmk"));
  }
  // This scene has nothing beyond its cameras, so that all its anchors lie on the grid: they are moved off it.
  done("attack --model " + trained("scaffold+farfield") + " --attack jitter:0.3 --out " + at("moved.safetensors"));
  const std::string moved = at("moved.safetensors"), out = at("moved-fitted");
  const testing::Outcome said =
      done("fit-codec --iterations 10 --model " + moved + " --data " + files().scene + " --out " + out);
  CHECK(said.text.find("lay off the grid") != std::string::npos);
  CHECK(block(moved, "anchor.position") != block(out + "/model.safetensors", "anchor.position"));
  done("evaluate --model " + out + "/model.safetensors --data " + files().scene + " --json " + at("fitted.json"));
  done("evaluate --model " + moved + " --data " + files().scene + " --json " + at("moved.json"));
  const double before = json_of(at("moved.json"))["psnr"].get<double>(),
               after = json_of(at("fitted.json"))["psnr"].get<double>();
  MESSAGE(before, " dB of the model as it was, ", after, " dB on the grid");
  CHECK(std::abs(before - after) < 0.05);
}

}  // namespace every_recipe_test
