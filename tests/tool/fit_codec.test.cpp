// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit-codec: a small file of a model that was not trained for one.
#include <doctest/doctest.h>

#include <compmark/io/safetensors.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace fit_codec_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-fit-codec-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small, trained for no codec.
const nlohmann::json& results() {
  static const nlohmann::json instance = [] {
    done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
    done("train --voxel-size 0.2 --effects none --iterations 300 --data " + at("scene") + " --out " + at("plain"));
    return json_of(at("plain/results.json"));
  }();
  return instance;
}
std::string plain() {
  static_cast<void>(results());
  return at("plain/model.safetensors");
}
std::string command(const std::string& out, const std::string& more = {}) {
  return "fit-codec --model " + plain() + " --data " + at("scene") +
         (more.find("--iterations") == std::string::npos ? " --iterations 200" : "") + " --out " + at(out) + " " + more;
}
std::vector<float> block(const std::string& model, const std::string& name) {
  const Result<SafetensorsFile> file = read_safetensors(model);
  REQUIRE(file);
  const Result<std::vector<float>> values = file->values<float>(name);
  REQUIRE(values);
  return *values;
}
/// Of the anchors and the rendering networks.
bool same_model(const std::string& a, const std::string& b) {
  for (const std::string name : {"anchor.position", "anchor.feature", "anchor.scaling", "anchor.offset"}) {
    if (block(a, name) != block(b, name)) return false;
  }
  for (const std::string head : {"mlp_opacity", "mlp_covariance", "mlp_color"}) {
    for (const char* part : {".0.weight", ".0.bias", ".2.weight", ".2.bias"}) {
      if (block(a, head + part) != block(b, head + part)) return false;
    }
  }
  return true;
}

}  // namespace

TEST_CASE("tool: fit-codec writes a small file of a plain model, which stays as it is") {
  for (const std::string codec : {"hac", "context_gs"}) {
    CAPTURE(codec);
    done(command(codec, "--codec " + codec));
    const nlohmann::json fitted = json_of(at(codec + "/results.json"));
    CHECK(fitted["recipe"] == codec + "+fitted");
    const nlohmann::json& compressed = fitted["compressed"];
    CHECK(compressed["codec"] == codec);
    MESSAGE(codec, ": ", compressed["bytes"].get<int>(), " bytes of ", fs::file_size(plain()), ", ",
            compressed["test"]["psnr"].get<double>(), " dB of ", results()["test"]["psnr"].get<double>());
    CHECK(compressed["bytes"].get<std::size_t>() * 5 < fs::file_size(plain()));
    CHECK(compressed["test"]["psnr"].get<double>() > results()["test"]["psnr"].get<double>() - 1);
    CHECK(same_model(plain(), at(codec + "/model.safetensors")));

    // The file is one as any other: it decodes by itself, and compress makes it again.
    done("decompress --model " + at(codec + "/model.cmk") + " --out " + at(codec + "_decoded.safetensors"));
    CHECK_FALSE(same_model(plain(), at(codec + "_decoded.safetensors")));  // rounded
    done("compress --model " + at(codec + "/model.safetensors") + " --out " + at(codec + "_again.cmk"));
    CHECK(testing::file_bytes(at(codec + "_again.cmk")) == testing::file_bytes(at(codec + "/model.cmk")));
    done("render --model " + at(codec + "/model.cmk") + " --out " + at(codec + "_images"));
  }
}

TEST_CASE("tool: fit-codec --touch-up trains the model on, and a run is not resumed as another one") {
  done(command("touched", "--touch-up --iterations 20"));
  CHECK_FALSE(same_model(plain(), at("touched/model.safetensors")));
  CHECK(block(plain(), "anchor.position") == block(at("touched/model.safetensors"), "anchor.position"));

  // A run that is killed and resumed writes the file of one that is not.
  const std::string run = "fit-codec --model " + plain() + " --data " + at("scene") + " --iterations 100";
  testing::killed(run, at("stopped"));
  done("attack --model " + plain() + " --int8 tensor --keep-positions --out " + at("edited.safetensors"));
  check_refused(tool("fit-codec --model " + at("edited.safetensors") + " --data " + at("scene") +
                     " --iterations 100 --resume --out " + at("stopped")),
                {"the model that was begun from"});
  done(run + " --resume --out " + at("stopped"));
  done(run + " --threads 1 --out " + at("whole"));
  CHECK(testing::file_bytes(at("stopped/model.cmk")) == testing::file_bytes(at("whole/model.cmk")));
}

TEST_CASE("tool: fit-codec takes the loss on alpha as one of training alone") {
  static_cast<void>(plain());
  done("train --recipe scaffold+alpha --iterations 20 --data " + at("scene") + " --out " + at("alpha"));
  done("fit-codec --model " + at("alpha/model.safetensors") + " --data " + at("scene") + " --iterations 20 --out " +
       at("alpha_fitted"));
  CHECK(json_of(at("alpha_fitted/results.json"))["recipe"] == "hac+fitted");
}

TEST_CASE("tool: what no codec can be fitted to is refused in one line") {
  done(command("short", "--iterations 20"));
  check_refused(
      tool("fit-codec --model " + at("short/model.safetensors") + " --data " + at("scene") + " --out " + at("twice")),
      {"hac+fitted", "compmark compress"});
  check_refused(tool("fit-codec --model " + at("short/model.cmk") + " --data " + at("scene") + " --out " + at("twice")),
                {"compressed already"});
  check_refused(tool("fit-codec --model " + plain() + " --data " + at("scene") + " --out " + at("plain")),
                {"--out", "worth keeping"});
  check_refused(tool("fit-codec --model " + plain() + " --data " + at("scene") + " --downscale 2 --out " + at("twice")),
                {"--downscale"});
  done("train --recipe compmark-host --iterations 20 --data " + at("scene") + " --out " + at("other"));
  check_refused(
      tool("fit-codec --model " + at("other/model.safetensors") + " --data " + at("scene") + " --out " + at("twice")),
      {"compmark-host", "compmark train --codec"});
  done("attack --model " + plain() + " --int8 channel --out " + at("off_grid.safetensors"));
  check_refused(
      tool("fit-codec --model " + at("off_grid.safetensors") + " --data " + at("scene") + " --out " + at("twice")),
      {"off_grid.safetensors", "anchor.position", "grid"});
  check_refused(tool("train --recipe hac+fitted --data " + at("scene") + " --out " + at("twice")), {"fit-codec"});
  CHECK_FALSE(fs::exists(at("twice/model.cmk")));
  CHECK_FALSE(fs::exists(at("twice/model.safetensors")));
}

}  // namespace fit_codec_test
