// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark register: cameras of renders, of photographs, and of what is no picture of the scene.
#include <doctest/doctest.h>

#include <compmark/core/random.hpp>
#include <compmark/io/image_file.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace register_command_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::tool;

}  // namespace

TEST_CASE("register finds the cameras of renders, says what is of another scene, and writes a page of both") {
  const testing::ScratchFolder folder("compmark-register-test");
  const auto at = [&](const std::string& name) { return (folder.path / name).string(); };
  done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
  done("train --voxel-size 0.2 --effects none --iterations 400 --data " + at("scene") + " --out " + at("run"));
  const std::string model = " --model " + at("run/model.safetensors");
  done("render" + model + " --out " + at("renders"));
  const Outcome all = tool("register --places 40" + model + " --images " + at("renders") + " --json " + at("all.json"));
  CHECK(all.code == 0);
  const nlohmann::json cameras = json_of(at("all.json"));
  CHECK(cameras["schema"] == "compmark.registration.1");
  REQUIRE(cameras["pictures"].size() == 4);
  for (const nlohmann::json& picture : cameras["pictures"]) {
    CHECK(picture["found"] == true);
    CHECK(picture["likeness"].get<double>() > 0.95);
    CHECK(picture["uncertainty_pixels"].get<double>() < 0.1);
    CHECK(picture["camera"]["width"] == 96);
    CHECK(picture["camera"]["rotation_camera_world"].size() == 9);
  }

  std::vector<float> noise(3 * 80 * 80);
  const Random random(1, 0, random_stage("test/register command"));
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<float>(random.uniform(i / 5));
  REQUIRE(write_png(folder.path / "renders" / "zz_noise.png", ImageView<const float>{noise.data(), 3, 80, 80}).ok());
  const Outcome some = tool("register --places 40" + model + " --images " + at("renders") + " --json " +
                            at("some.json") + " --html " + at("page.html"));
  CHECK(some.code == 1);
  CHECK(some.text.find("4 of 5 found") != std::string::npos);
  const nlohmann::json last = json_of(at("some.json"))["pictures"][4];
  CHECK(last["found"] == false);
  CHECK(last.count("camera") == 0);
  const std::string page = testing::text_of(at("page.html"));
  CHECK(testing::times_in(page, "data:image/png") == 3 * 4);
  CHECK(page.find("not of this scene") != std::string::npos);

  // A picture that is too small is left out, and said; the others are told all the same.
  REQUIRE(write_png(folder.path / "renders" / "tiny.png", ImageView<const float>{noise.data(), 3, 16, 16}).ok());
  const Outcome rest =
      tool("register --places 40" + model + " --images " + at("renders") + " --json " + at("rest.json"));
  CHECK(rest.code == 2);
  CHECK(rest.text.find("4 of 6 found") != std::string::npos);
  const nlohmann::json tiny = json_of(at("rest.json"))["pictures"][4];
  CHECK(tiny["name"] == "tiny.png");
  CHECK(tiny["error"].get<std::string>().find("16 x 16") != std::string::npos);
  CHECK(json_of(at("rest.json"))["pictures"][3]["found"] == true);

  check_refused(tool("register" + model + " --images " + at("nothing")), {"nothing"});
  check_refused(tool("register" + model + " --images " + at("renders") + " --json " + at("run/model.safetensors")),
                {"--json"});
}

}  // namespace register_command_test
