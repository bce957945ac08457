// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The command-line tool as its user meets it: a whole path on the built-in scene, the same model for any number of threads and after a
// kill, and for every bad input one line that names file, field and remedy, exit code 2, and nothing touched.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/buffer.hpp>
#include <compmark/core/views.hpp>
#include <compmark/io/anchor_ply.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/io/splat_ply.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tool/running.hpp"

namespace tool_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-tool-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small, written once.
const std::string& scene() {
  static const std::string path = [] {
    const std::string target = at("scene");
    const Outcome outcome = tool("scene --out " + target + " --width 48 --height 40 --train 8 --test 3");
    REQUIRE(outcome.code == 0);
    return target;
  }();
  return path;
}

std::string train(const std::string& out, const std::string& options = "") {
  const Outcome outcome = tool("train --data " + scene() + " --out " + at(out) + " --iterations 120 " + options);
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  return json_of(at(out) + "/results.json")["model_sha256"].get<std::string>();
}

/// A copy of the scene to damage.
std::string damaged(const std::string& name) {
  const std::string path = at("damaged-" + name);
  fs::remove_all(path);
  fs::copy(scene(), path, fs::copy_options::recursive);
  return path;
}
void write_text(const std::string& path, const std::string& text) {
  REQUIRE(write_file(path, std::string_view(text)).ok());
}

}  // namespace

TEST_CASE(
    "tool: probe says what the built-in scene calls for, and train takes the recipe for it unless told otherwise") {
  const Outcome probe = tool("probe --json --data " + scene());
  REQUIRE(probe.code == 0);
  const nlohmann::json json = nlohmann::json::parse(probe.text);
  REQUIRE(json["effects"].size() == 1);
  CHECK(json["effects"][0]["name"] == "alpha");
  CHECK(json["effects"][0]["value"].get<double>() > json["effects"][0]["limit"].get<double>());
  CHECK(json["recipe"] == "scaffold+alpha");
  CHECK(tool("probe --data " + scene()).text.find("transparent") != std::string::npos);

  const auto trained = [](const std::string& name, const std::string& more) {
    const std::string out = at(name);
    const Outcome outcome = tool("train --iterations 20 --data " + scene() + " --out " + out + " " + more);
    INFO(outcome.text);
    REQUIRE(outcome.code == 0);
    return json_of(out + "/results.json");
  };
  const nlohmann::json chosen = trained("effects-auto", "");
  CHECK(chosen["recipe"] == "scaffold+alpha");
  CHECK(chosen["effects"] == nlohmann::json{"alpha"});
  const nlohmann::json none = trained("effects-none", "--effects none");
  CHECK(none["recipe"] == "scaffold");
  CHECK(none["effects"].empty());
  CHECK(trained("effects-list", "--effects exposure,masks")["recipe"] == "scaffold+exposure+mask");
  const nlohmann::json both = trained("effects-both", "--effects anti_aliasing,alpha");
  CHECK(both["recipe"] == "scaffold+alpha+antialiasing");
  CHECK(both["effects"] == nlohmann::json{"anti_aliasing", "alpha"});
  CHECK(tool("render --model " + at("effects-both/model.safetensors") + " --out " + at("effects-both/renders")).code ==
        0);
  CHECK(trained("effects-recipe", "--recipe scaffold+antialiasing")["recipe"] == "scaffold+antialiasing");
  CHECK(tool("evaluate --data " + scene() + " --model " + at("effects-list/model.safetensors")).code == 0);
  const Outcome unknown = tool("train --data " + scene() + " --out " + at("x") + " --effects fog");
  CHECK(unknown.code == 2);
  CHECK(unknown.text.find("fog") != std::string::npos);
}

TEST_CASE("tool: a training in which nothing is drawn any more is brought back, and says so") {
  // Black photographs but for a pixel: every opacity falls below 0, and there no gradient reaches it any more.
  done("scene --out " + at("black") + " --width 32 --height 32 --train 6 --test 2");
  std::vector<float> nothing(3 * 32 * 32, 0);
  nothing[0] = 1 / 255.0F;
  for (const char* split : {"train", "test"}) {
    for (const fs::directory_entry& photograph : fs::directory_iterator(at("black/") + split))
      REQUIRE(write_png(photograph.path(), ImageView<const float>{nothing.data(), 3, 32, 32}).ok());
  }
  const Outcome cured = tool("train --voxel-size 0.3 --iterations 300 --data " + at("black") + " --out " + at("cured"));
  INFO(cured.text);
  CHECK(cured.code == 0);
  CHECK(cured.text.find("the opacities were set anew") != std::string::npos);
  const nlohmann::json results = json_of(at("cured/results.json"));
  REQUIRE(results.contains("revivals"));
  CHECK(results["revivals"] >= 1);
  CHECK(testing::text_of(at("cured/log.jsonl")).find("\"revivals\":") != std::string::npos);
}

TEST_CASE("tool: scene, train, info, render, evaluate and export work on the built-in scene") {
  train("run");
  for (const char* file : {"model.safetensors", "results.json", "report.html", "log.jsonl"})
    CHECK(fs::file_size(at("run") + "/" + file) > 100);
  const nlohmann::json results = json_of(at("run/results.json"));
  for (const char* key : {"schema", "dataset", "recipe", "profile", "iterations", "seed", "threads", "anchors",
                          "gaussians_per_view", "train_seconds", "peak_memory_mb", "test", "model_sha256", "effects"}) {
    INFO(key);
    CHECK(results.contains(key));
  }
  for (const char* key : {"psnr", "ssim", "lpips_alex", "views"}) CHECK(results["test"].contains(key));
  CHECK(results["test"]["views"] == 3);
  CHECK(results["model_sha256"].get<std::string>().size() == 64);

  CHECK(tool("info " + at("run/model.safetensors")).text.find(results["model_sha256"].get<std::string>()) !=
        std::string::npos);
  const Outcome render = tool("render --model " + at("run/model.safetensors") + " --out " + at("renders"));
  INFO(render.text);
  CHECK(render.code == 0);
  std::size_t images = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(at("renders")))
    images += entry.path().extension() == ".png" ? 1 : 0;
  CHECK(images == 3);

  CHECK(tool("evaluate --model " + at("run/model.safetensors") + " --data " + scene() + " --json " +
             at("evaluation.json"))
            .code == 0);
  CHECK(json_of(at("evaluation.json"))["psnr"].get<double>() ==
        doctest::Approx(results["test"]["psnr"].get<double>()).epsilon(1e-9));
  CHECK(tool("export --model " + at("run/model.safetensors") + " --out " + at("anchors.ply") + " --format anchors")
            .code == 0);
  const Outcome splat = tool("export --model " + at("run/model.safetensors") + " --out " + at("splats.ply") +
                             " --sh-degree 2 --refine 20 --data " + scene());
  INFO(splat.text);
  CHECK(splat.code == 0);
  CHECK(splat.text.find("loss of the bake") != std::string::npos);
  CHECK(fs::file_size(at("splats.ply")) > 1000);
}

TEST_CASE("tool: a lens is projected through from training to evaluation, and its data are those of the family only") {
  const auto write = [](const std::string& name, const Lens& lens) {
    ProceduralSettings settings;
    settings.width = settings.height = 40;
    settings.views_train = 8;
    settings.views_test = 2;
    settings.camera_angle_x = 1.2;
    settings.camera_distance = 2.4;
    settings.lens = lens;
    REQUIRE(write_procedural_scene(at(name), settings).ok());
    return at(name);
  };
  const std::string radial = write("radial", {LensModel::opencv, {-0.25, 0.05, 0.002, -0.001}});
  const std::string fisheye = write("fisheye", {LensModel::opencv_fisheye, {-0.03, 0.004, 0, 0}});
  for (const auto& [data, effect, recipe] :
       {std::tuple(radial, "lens_distortion", "scaffold+lens"), std::tuple(fisheye, "fisheye", "scaffold+fisheye")}) {
    const std::string run = at(std::string("run-") + effect);
    const Outcome trained = tool("train --iterations 60 --lens project --effects " + std::string(effect) + " --data " +
                                 data + " --out " + run);
    INFO(trained.text);
    REQUIRE(trained.code == 0);
    const nlohmann::json results = json_of(run + "/results.json");
    CHECK(results["recipe"] == recipe);
    CHECK(results["effects"] == nlohmann::json{effect});
    // Evaluated with the lens that the data have and rendered with the one that the model stores: the same pictures.
    CHECK(tool("evaluate --model " + run + "/model.safetensors --data " + data + " --json " + at("lens.json")).code ==
          0);
    CHECK(json_of(at("lens.json"))["psnr"].get<double>() ==
          doctest::Approx(results["test"]["psnr"].get<double>()).epsilon(1e-9));
    CHECK(tool("render --model " + run + "/model.safetensors --out " + run + "/stored").code == 0);
    CHECK(tool("render --model " + run + "/model.safetensors --out " + run + "/data --data " + data).code == 0);
    CHECK(
        tool("", "cmp " + run + "/stored/test_r_000.png " + run + "/data/test_r_000.png; true ").text.find("differ") ==
        std::string::npos);
    CHECK(fs::exists(run + "/stored/test_r_000.png"));
  }
  const Outcome other = tool("evaluate --model " + at("run-lens_distortion/model.safetensors") + " --data " + fisheye);
  CHECK(other.code == 2);
  CHECK(other.text.find("radial and tangential") != std::string::npos);

  // A run that was stopped goes on through the same lens alone: not with another treatment, not with other coefficients.
  const std::string resume = "train --iterations 5000 --checkpoint-every 5 --resume --out " + at("lens-stopped");
  static_cast<void>(tool(resume + " --recipe scaffold+lens --data " + radial + " 2>&1 & pid=$!; while [ ! -f " +
                         at("lens-stopped/checkpoint.safetensors") +
                         " ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; kill -TERM $pid; wait $pid #"));
  REQUIRE(fs::exists(at("lens-stopped/checkpoint.safetensors")));
  const auto check_resume = [&](const std::string& more, const std::string& piece) {
    const Outcome outcome = tool(resume + more);
    INFO(outcome.text);
    CHECK(outcome.code == 2);
    const std::size_t line = outcome.text.rfind("compmark: error: ");  // after the warnings of the readers
    REQUIRE(line != std::string::npos);
    for (const std::string& part :
         {std::string("checkpoint.safetensors"), piece, std::string("resume with the options")})
      CHECK(outcome.text.find(part, line) != std::string::npos);
  };
  check_resume(" --recipe scaffold+lens --lens ignore --data " + radial,
               "effects: are lens_distortion in the checkpoint and lens_ignored now");
  check_resume(" --recipe scaffold+mask --lens undistort --data " + radial,
               "recipe: is scaffold+lens in the checkpoint and scaffold+mask now");
  const std::string weaker = write("radial-weaker", {LensModel::opencv, {-0.25, 0.05, 0.002, -0.0011}});
  check_resume(" --recipe scaffold+lens --data " + weaker, "lens: of view 0 (./train/r_000) is another one");
}

TEST_CASE("tool: export writes every format of splats, tells its price, and its own commands read the file") {
  train("run-formats", "--effects none");
  for (const auto& [ending, word] :
       std::vector<std::pair<std::string, std::string>>{{".ply", "ply"},
                                                        {".compressed.ply", "compressed-ply"},
                                                        {".spz", "spz"},
                                                        {".splat", "antimatter-splat"},
                                                        {".sog", "sog"},
                                                        {".glb", "glb"}}) {
    const std::string out = at("formats" + ending), json = at("formats" + ending + ".json");
    CAPTURE(out);
    const Outcome exported = tool("export --model " + at("run-formats/model.safetensors") +
                                  " --sh-degree 1 --refine 0 --compare 1 --out " + out + " --json " + json);
    INFO(exported.text);
    REQUIRE(exported.code == 0);
    const nlohmann::json told = json_of(json);
    CHECK(told["file"]["format"] == word);
    CHECK(told["file"]["bytes"].get<std::uintmax_t>() == fs::file_size(out));
    CHECK(told["held_out"] == true);
    CHECK(told.contains("psnr_of_file_to_model") == (word != "ply"));
    CHECK((exported.text.find("the price of the format") != std::string::npos) == (word != "ply"));
    CHECK(exported.text.find("that nothing was fitted over") != std::string::npos);
    const Outcome info = tool("info " + out);
    INFO(info.text);
    CHECK(info.code == 0);
    CHECK(info.text.find(std::to_string(told["gaussians"].get<std::size_t>()) + ", spherical harmonics of degree " +
                         (word == "antimatter-splat" ? "0" : "1")) != std::string::npos);
  }
  const std::string model = " --model " + at("run-formats/model.safetensors") + " --refine 0 --compare 0 ";
  REQUIRE(tool("export" + model + "--spz-version 3 --spz-bits 9 --out " + at("old.spz") + " --json " + at("old.json"))
              .code == 0);
  CHECK(json_of(at("old.json"))["file"]["version"] == 3);
  CHECK(json_of(at("old.json"))["file"]["fractional_bits"] == 9);
  REQUIRE(tool("export" + model + "--format sog --out " + at("named.bin")).code == 0);
  CHECK(tool("info " + at("named.bin")).text.find("a SOG file") != std::string::npos);
  check_refused(tool("export" + model + "--out " + at("scene.sogs")), {"--out", ".sogs", ".sog"});
}

TEST_CASE("tool: an export says on stderr and in its JSON what the file cannot") {
  const std::string run = at("run-filter");
  REQUIRE(tool("train --iterations 20 --recipe scaffold+antialiasing+mask --data " + scene() + " --out " + run).code ==
          0);
  const Outcome exported = tool("export --model " + run + "/model.safetensors --refine 0 --compare 1 --out " + run +
                                "/splats.ply --json " + run + "/export.json");
  INFO(exported.text);
  REQUIRE(exported.code == 0);
  CHECK(exported.text.find("warning: the model was trained with the mip filter") != std::string::npos);
  const nlohmann::json json = json_of(run + "/export.json");
  REQUIRE(json["warnings"].size() == 1);
  CHECK(json["warnings"][0].get<std::string>().find("0.3 pixels^2") != std::string::npos);
  CHECK(json["gaussians"].get<std::size_t>() > 0);
  train("run-plain", "--effects none");
  REQUIRE(tool("export --model " + at("run-plain/model.safetensors") + " --format anchors --out " + run +
               "/a.ply --json " + run + "/plain.json")
              .code == 0);
  CHECK(json_of(run + "/plain.json")["warnings"].empty());
}

namespace {
/// A copy of the scene with `keep` training views, whose cameras stand at change(coordinate, axis).
template <class Change>
std::string with_places(const std::string& name, std::size_t keep, const Change& change) {
  const std::string path = damaged(name);
  for (const char* file : {"/transforms_train.json", "/transforms_test.json"}) {
    nlohmann::json json = json_of(path + file);
    for (auto& frame : json["frames"]) {
      for (std::size_t row = 0; row < 3; ++row) {
        double& entry = frame["transform_matrix"][row][3].get_ref<double&>();
        entry = change(entry, row);
      }
    }
    if (std::string(file) == "/transforms_train.json")
      json["frames"].erase(json["frames"].begin() + static_cast<std::ptrdiff_t>(keep), json["frames"].end());
    write_text(path + file, json.dump());
  }
  return path;
}
}  // namespace

TEST_CASE("tool: a scene far from the origin is rendered alike from every folder of the same world") {
  // A copy whose world is moved by 5e5: the reader moves it back by the mean of its cameras, which is not that of a part of them.
  const auto moved = [](const std::string& name, std::size_t keep) {
    return with_places(name, keep, [](double x, std::size_t row) { return x + (row == 1 ? -2.5e5 : 5e5); });
  };
  const std::string whole = moved("far", 8), part = moved("far-part", 3), run = at("run-far");
  REQUIRE(tool("train --iterations 60 --effects none --data " + whole + " --out " + run).code == 0);
  for (const auto& [data, out] : {std::pair(whole, "/whole"), std::pair(part, "/part")})
    REQUIRE(tool("render --model " + run + "/model.safetensors --out " + run + out + " --data " + data).code == 0);
  const Result<ImageBytes> a = read_image(run + "/whole/test_r_000.png"), b = read_image(run + "/part/test_r_000.png");
  REQUIRE(a.ok());
  REQUIRE(b.ok());
  int worst = 0;
  for (std::size_t i = 0; i < a->pixels.size(); ++i)
    worst = std::max(worst, std::abs(static_cast<int>(a->pixels[i]) - static_cast<int>(b->pixels[i])));
  CHECK(worst <= 1);  // without the stored origin the two means are 1.5 apart and the pictures have nothing in common
  CHECK(std::any_of(a->pixels.begin(), a->pixels.end(), [](std::uint8_t x) { return x > 60; }));
}

TEST_CASE(
    "tool: a scene in millimetres is rendered alike from every folder of the same world, and exported in millimetres") {
  const auto scaled = [](const std::string& name, std::size_t keep) {
    return with_places(name, keep, [](double x, std::size_t) { return 1024 * x; });
  };
  const std::string large = scaled("large", 8), part = scaled("large-part", 1), plain = at("scene"),
                    run = at("run-large"), model = " --model " + run + "/model.safetensors ";
  const Outcome trained = tool("train --iterations 60 --effects none --data " + large + " --out " + run);
  REQUIRE(trained.code == 0);
  CHECK(trained.text.find("lengths are counted in units of") != std::string::npos);
  for (const auto& [data, out] : {std::pair(large, "/whole"), std::pair(part, "/part"), std::pair(plain, "/plain")})
    REQUIRE(tool("render" + model + "--out " + run + out + " --data " + data).code == 0);
  const auto pixels = [&](const std::string& out) {
    const Result<ImageBytes> image = read_image(run + out + "/test_r_000.png");
    REQUIRE(image.ok());
    return image->pixels;
  };
  const std::vector<std::uint8_t> whole = pixels("/whole");
  CHECK(whole == pixels("/part"));   // whatever unit that folder would have by itself
  CHECK(whole != pixels("/plain"));  // the control: there the cameras of another world stand, all in one place
  CHECK(std::any_of(whole.begin(), whole.end(), [](std::uint8_t x) { return x > 60; }));

  // Anchors and splats are in the coordinates of the files, in which cameras stand 4,000 away.
  REQUIRE(tool("export" + model + "--format anchors --out " + run + "/anchors.ply").code == 0);
  REQUIRE(tool("export" + model + "--sh-degree 0 --refine 0 --compare 0 --out " + run + "/splats.ply").code == 0);
  const Result<SafetensorsFile> file = read_safetensors(run + "/model.safetensors");
  const Result<AnchorPly> anchors = read_anchor_ply(run + "/anchors.ply");
  const Result<SplatPly> splats = read_splat_ply(run + "/splats.ply");
  REQUIRE(file.ok());
  REQUIRE(anchors.ok());
  REQUIRE(splats.ok());
  const double unit = json_from<nlohmann::json>(*file->text_of("info"))["unit"].get<double>();
  CHECK(unit == std::exp2(std::round(std::log2(unit))));
  CHECK(unit > 256);  // cameras 4,000 away are 4 to 8 units away
  CHECK(unit < 2048);
  const std::vector<float> position = *file->values<float>("anchor.position"),
                           scaling = *file->values<float>("anchor.scaling");
  REQUIRE(anchors->position.size() == position.size());
  for (std::size_t i = 0; i < position.size(); ++i)
    CHECK(anchors->position[i] == static_cast<float>(unit) * position[i]);
  for (std::size_t i = 0; i < scaling.size(); ++i)
    CHECK(anchors->scaling[i] == doctest::Approx(static_cast<double>(scaling[i]) + std::log(unit)).epsilon(1e-6));
  float widest = 0;
  double scale = 0;
  const SplatTable& table = splats->table;
  for (std::size_t i = 0; i < table.count; ++i) {
    widest = std::max(widest, std::abs(table.mean[0][i]));
    scale += static_cast<double>(table.log_scale[0][i]) / static_cast<double>(table.count);
  }
  CHECK(widest > 512);
  CHECK(widest < 8192);
  CHECK(scale > 0);  // of anchors a few hundredths apart in units of 512 or more; a splat of e^-3 would be a speck
}

TEST_CASE("tool: the same seed gives the same model_sha256 for 1, 2 and 4 threads, another seed another") {
  const std::string one = train("threads1", "--threads 1");
  CHECK(train("threads1again", "--threads 1") == one);
  CHECK(train("threads2", "--threads 2") == one);
  CHECK(train("threads4", "--threads 4") == one);
  CHECK(train("seed7", "--threads 2 --seed 7") != one);
}

TEST_CASE("tool: a run that is killed and resumed ends in the same model_sha256") {
  const std::string reference = train("uninterrupted", "--checkpoint-every 10");
  // SIGKILL as soon as a checkpoint is there: where the run stands then does not matter.
  const Outcome killed = tool("train --data " + scene() + " --out " + at("killed") +
                              " --iterations 120 --checkpoint-every 10 2>&1 & pid=$!; while [ ! -f " +
                              at("killed/checkpoint.safetensors") +
                              " ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; kill -9 $pid; wait $pid #");
  CHECK(killed.code != 0);
  REQUIRE(fs::exists(at("killed/checkpoint.safetensors")));
  CHECK(!fs::exists(at("killed/model.safetensors")));
  check_refused(tool("train --data " + scene() + " --out " + at("killed") + " --iterations 120"),
                {"checkpoint.safetensors", "--resume"});
  check_refused(tool("train --data " + scene() + " --out " + at("killed") + " --iterations 130 --resume"),
                {"checkpoint.safetensors", "iterations is 120"});
  CHECK(train("killed", "--resume") == reference);

  // What a run began with need not be told again, though a probe would choose another recipe for these data.
  const std::string told = " --recipe scaffold --background white --checkpoint-every 10 ";
  const std::string white = train("told", told);
  CHECK(white != reference);
  static_cast<void>(tool("train --data " + scene() + " --out " + at("told-killed") + " --iterations 120" + told +
                         "2>&1 & pid=$!; while [ ! -f " + at("told-killed/checkpoint.safetensors") +
                         " ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; kill -9 $pid; wait $pid #"));
  REQUIRE(fs::exists(at("told-killed/checkpoint.safetensors")));
  CHECK(train("told-killed", "--resume") == white);

  // Ctrl-C writes a checkpoint of the very iteration.
  const Outcome interrupted =
      tool("train --data " + scene() + " --out " + at("interrupted") +
           " --iterations 120 2>&1 & pid=$!; while [ ! -f " + at("interrupted/log.jsonl") +
           " ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; sleep 0.1; kill -TERM $pid; wait $pid #");
  if (fs::exists(at("interrupted/checkpoint.safetensors"))) {
    CHECK(interrupted.text.find("continue with --resume") != std::string::npos);
    CHECK(train("interrupted", "--resume") == reference);
  } else {
    MESSAGE("the run was over before the signal came");
  }
}

TEST_CASE("tool: a bad dataset is one error line with file, field and remedy, and leaves the output untouched") {
  const auto refused = [](const std::string& data, const std::vector<std::string>& pieces) {
    INFO(data);
    check_refused(tool("train --data " + data + " --out " + at("untouched") + " --iterations 10"), pieces);
    CHECK(!fs::exists(at("untouched/model.safetensors")));
  };
  refused(at("missing"), {"missing", ";"});
  fs::create_directories(at("empty"));
  refused(at("empty"), {"empty", ";"});

  std::string data = damaged("no-json");
  write_text(data + "/transforms_train.json", "{ this is not JSON");
  refused(data, {"transforms_train.json", ";"});

  data = damaged("no-poses");
  write_text(data + "/transforms_train.json", "{\"camera_angle_x\": 0.7}");
  refused(data, {"transforms_train.json", "frames", ";"});

  data = damaged("no-images");
  nlohmann::json transforms = json_of(data + "/transforms_train.json");
  transforms["frames"] = nlohmann::json::array();
  write_text(data + "/transforms_train.json", transforms.dump());
  refused(data, {"transforms_train.json", "frames", ";"});

  data = damaged("nan-pose");
  transforms = json_of(data + "/transforms_train.json");
  transforms["frames"][2]["transform_matrix"][0][3] = nullptr;  // what JSON writers make of NaN
  write_text(data + "/transforms_train.json", transforms.dump());
  refused(data, {"transforms_train.json", "transform_matrix", ";"});

  data = damaged("truncated-image");
  transforms = json_of(data + "/transforms_train.json");
  fs::path image = fs::path(data) / transforms["frames"][1]["file_path"].get<std::string>();
  if (!fs::exists(image)) image += ".png";
  fs::resize_file(image, fs::file_size(image) / 2);
  refused(data, {image.filename().string(), ";"});

  data = damaged("missing-image");  // one is left out with a word, all of them are an error
  image = fs::path(data) / transforms["frames"][0]["file_path"].get<std::string>();
  if (!fs::exists(image)) image += ".png";
  fs::remove(image);
  const Outcome one_less = tool("train --data " + data + " --out " + at("one-less") + " --iterations 10");
  CHECK(one_less.code == 0);
  CHECK(one_less.text.find("1 of 8 images are missing") != std::string::npos);
  CHECK(one_less.text.find(image.stem().string()) != std::string::npos);
  for (const auto& frame : transforms["frames"]) {
    fs::path path = fs::path(data) / frame["file_path"].get<std::string>();
    if (!fs::exists(path)) path += ".png";
    fs::remove(path);
  }
  refused(data, {"transforms_train.json", ";"});

  data = damaged("other-size");
  image = fs::path(data) / transforms["frames"][3]["file_path"].get<std::string>();
  if (!fs::exists(image)) image += ".png";
  Buffer<float> grey(3 * 20 * 20);
  for (float& value : grey) value = 0.5f;
  REQUIRE(write_png(image, ImageView<const float>{grey.data(), 3, 20, 20}).ok());
  const Outcome mixed = tool("train --data " + data + " --out " + at("untouched") + " --iterations 10");
  INFO(mixed.text);
  CHECK((mixed.code == 0 || mixed.code == 2));  // mixed sizes are either modelled or refused, never mistaken
  if (mixed.code == 2) check_refused(mixed, {image.filename().string(), "20"});
}

TEST_CASE("tool: results.json comes last, so a run that could not write its page is not taken as finished") {
  fs::create_directories(at("no-page/report.html/in-the-way"));
  const Outcome outcome = tool("train --data " + scene() + " --out " + at("no-page") + " --iterations 20");
  INFO(outcome.text);
  CHECK(outcome.code == 2);
  CHECK(outcome.text.find("error: " + at("no-page/report.html")) != std::string::npos);
  CHECK(fs::exists(at("no-page/model.safetensors")));  // written before, and good
  CHECK_FALSE(fs::exists(at("no-page/results.json")));
}

TEST_CASE("tool: bad options, an unwritable output and a damaged model are one error line each") {
  check_refused(tool("train --data " + scene() + " --out " + at("x") + " --profile nobody"),
                {"--profile", "nobody", "scaffold"});
  check_refused(tool("train --data " + scene() + " --out " + at("x") + " --recipe nothing"), {"recipe", "nothing"});
  check_refused(tool("train --data " + scene() + " --out " + at("x") + " --max-anchors 3"), {"max_anchors"});
  for (const char* levels : {"2", "2:1", "1:0.5", "2:0.2,4:0.6"})
    check_refused(tool("train --data " + scene() + " --out " + at("x") + " --coarse-to-fine " + levels),
                  {"--coarse-to-fine"});
  check_refused(tool("train --data " + scene() + " --out " + at("x") + " --coarse-to-fine 16:0.5"),
                {"--coarse-to-fine", "makes its photograph of"});
  write_text(at("a-file"), "text");
  check_refused(tool("train --data " + scene() + " --out " + at("a-file")), {"a-file"});
  check_refused(tool("train --data " + scene() + " --out /proc/nowhere"), {"/proc/nowhere"});
  check_refused(tool("info " + at("missing.safetensors")), {"missing.safetensors"});

  train("whole");
  const std::string model = at("whole/model.safetensors");
  const std::string broken = at("broken.safetensors");
  const std::size_t size = fs::file_size(model);
  for (const std::size_t kept : {std::size_t{0}, std::size_t{7}, std::size_t{100}, size / 2, size - 1}) {
    fs::copy_file(model, broken, fs::copy_options::overwrite_existing);
    fs::resize_file(broken, kept);
    check_refused(tool("render --model " + broken + " --out " + at("none")), {"broken.safetensors", ";"});
    check_refused(tool("info " + broken), {"broken.safetensors", ";"});
  }
  CHECK(!fs::exists(at("none")));
  check_refused(tool("export --model " + model + " --out " + at("no/such/folder/a.ply")), {"a.ply"});
  const std::string some = "render --model " + model + " --out " + at("none") + " --view ";
  check_refused(tool(some + "nobody"), {"model.safetensors", "--view", "nobody", "info --views"});
  // One of two that is missing is not passed over.
  const std::string listed = tool("info --views " + model).text;
  const std::size_t row = listed.rfind(" test ");
  REQUIRE(row != std::string::npos);
  const std::size_t begin = listed.rfind("\n    ", row) + 5;
  const std::string name = listed.substr(begin, listed.find(' ', begin) - begin);
  CAPTURE(name);
  check_refused(tool(some + name + " nobody"), {"--view", "nobody"});
  check_refused(tool("render --model " + model + " --out " + at("none") + " --data " + scene() + " --view nobody"),
                {"--view", "nobody", "dataset"});
  CHECK(!fs::exists(at("none")));
  CHECK(tool(some + name).code == 0);
}

TEST_CASE("tool: doctor says what there is, and what would help where something is missing") {
  const Outcome said = done("doctor");
  for (const char* name : {"version", "instruction set", "threads", "free memory", "decoder of every scene", "libzstd"})
    CHECK_MESSAGE(said.text.find(name) != std::string::npos, name);
  const nlohmann::json json = nlohmann::json::parse(done("doctor --json").text);
  CHECK(json["schema"] == "compmark.doctor.1");
  CHECK(json["findings"].size() >= 9);
  std::size_t advised = 0;
  for (const nlohmann::json& finding : json["findings"])
    advised += finding["advice"].get<std::string>().empty() ? 0 : 1;
  const std::string last = advised == 0 ? "nothing is missing" : std::to_string(advised) + " could be better";
  CHECK(said.text.find(last) != std::string::npos);
}

}  // namespace tool_test
