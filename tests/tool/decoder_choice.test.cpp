// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The decoder of who names none: the one for every scene, which comes with the program; and --decoder fit, which asks for one of the scene.
#include <doctest/doctest.h>

#include <compmark/io/image_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace decoder_choice_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-decoder-choice-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small, and a model of it without a message.
const std::string& unmarked() {
  static const std::string model = [] {
    done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
    REQUIRE(write_key(at("owner.key"), testing::fixed_key(1, 48)).ok());
    done("train --voxel-size 0.2 --effects none --iterations 400 --data " + at("scene") + " --out " + at("plain"));
    return at("plain/model.safetensors");
  }();
  return model;
}
std::string embed(const std::string& out) {
  return "embed --model " + unmarked() + " --data " + at("scene") + " --key " + at("owner.key") + " --out " + at(out);
}

}  // namespace

TEST_CASE("tool: who names no decoder hides and reads with the one of every scene, also in edited pictures") {
  done(embed("marked") + " --iterations 250 --fidelity 200");
  CHECK_FALSE(fs::exists(at("marked/decoder.safetensors")));  // none was fitted
  const nlohmann::json mark = json_of(at("marked/results.json"))["run"]["settings"]["mark"];
  CHECK(mark["edited_share"] == 0.7);
  CHECK(mark["draw_by_cost"] == 1.0);
  CHECK(mark["orbit_share"] == 0.5);
  CHECK(mark["photograph_share"] == 0.5);
  CHECK(mark["hinge_power"] == 2.0);
  const std::string key =
      " --key " + at("owner.key") + " --alpha 1e-3 --json " + at("proof.json") + testing::claimed(at("owner.key"));
  CHECK(tool("verify --split all --model " + at("marked/model.safetensors") + key).code == 0);
  const nlohmann::json proof = json_of(at("proof.json"));
  MESSAGE("all views: ", proof["matches"].get<int>(), " of 48, in the mean ",
          proof["bit_accuracy"]["mean"].get<double>());
  CHECK(proof["decoder"]["file"].get<std::string>().rfind("universal", 0) == 0);
  CHECK(tool("verify --split all --model " + unmarked() + key).code == 1);  // the control

  // Nothing but pictures and the key; a page round them and another size are no edits.
  done("render --model " + at("marked/model.safetensors") + " --split all --out " + at("renders"));
  fs::create_directories(at("pages"));
  for (const fs::directory_entry& entry : fs::directory_iterator(at("renders"))) {
    const Result<ImageBytes> picture = read_image(entry.path());
    REQUIRE(picture.ok());
    ImageBytes page{240, 200, 3, std::vector<std::uint8_t>(3 * 200 * 240, 102)};
    for (int y = 0; y < picture->height; ++y) {
      for (int x = 0; x < picture->width; ++x) {
        for (int c = 0; c < 3; ++c) {
          page.pixels[static_cast<std::size_t>(3 * (240 * (y + 70) + x + 40) + c)] =
              picture->pixels[static_cast<std::size_t>(picture->channels * (picture->width * y + x) + c)];
        }
      }
    }
    REQUIRE(write_png(fs::path(at("pages")) / entry.path().filename(), page).ok());
  }
  CHECK(tool("verify --images " + at("pages") + key).code == 0);
  // Another decoder, or none that fits the record, is not taken for it.
  check_refused(tool("verify --images " + at("pages") + key + " --decoder weights/lattice_48.safetensors"),
                {"lattice_48.safetensors", "--any-decoder"});
}

TEST_CASE("tool: --decoder fit asks for a decoder of the scene, which is found beside the model") {
  // Numbers of a decoder that is fitted belong to no other.
  check_refused(tool(embed("none") + " --period 0.2"), {"--period", "--decoder fit"});
  CHECK_FALSE(fs::exists(at("none/model.safetensors")));
  done(embed("fitted") + " --decoder fit --iterations 2");
  CHECK(fs::exists(at("fitted/decoder.safetensors")));
  CHECK(json_of(at("fitted/results.json"))["run"]["settings"]["mark"].value("edited_share", 0.0) == 0);
  (void)tool("verify --model " + at("fitted/model.safetensors") + " --key " + at("owner.key") +
             " --any-decoder --json " + at("fitted.json"));
  CHECK(json_of(at("fitted.json"))["decoder"]["file"] == "decoder.safetensors");
}

}  // namespace decoder_choice_test
