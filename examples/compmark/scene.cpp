// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark scene: writes the built-in scene, so that everything can be tried without any data.
#include <compmark/scene/procedural_write.hpp>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "common.hpp"
#include "run_folder.hpp"

namespace tool {

Command add_scene(Options& app) {
  struct Told {
    std::filesystem::path out;
    compmark::ProceduralSettings scene;
  };
  auto options = std::make_shared<Told>();
  app.writes_into("--out", options->out, "folder to write (Blender format: transforms_*.json and PNG images)")
      ->required();
  app.number("--width", options->scene.width, WholeRange{8, 4096}, "pixels")->capture_default_str();
  app.number("--height", options->scene.height, WholeRange{8, 4096}, "pixels")->capture_default_str();
  app.number("--train", options->scene.views_train, WholeRange{1, 10000}, "training views")->capture_default_str();
  app.number("--test", options->scene.views_test, WholeRange{0, 10000}, "test views")->capture_default_str();
  app.number("--seed", options->scene.seed, any_seed, "seed of camera positions and textures")->capture_default_str();
  app.also([options](FileUse& use) {
    use.write_in(options->out, {"transforms_train.json", "transforms_test.json"}, "--out");
  });
  return [options]() -> int {
    const auto held = compmark::hold_folder(options->out);
    if (!held) return fail(held.error());
    if (auto written = compmark::write_procedural_scene(options->out, options->scene); !written)
      return fail(written.error());
    std::printf("%s: %d training and %d test views of %d x %d pixels\n", options->out.string().c_str(),
                static_cast<int>(options->scene.views_train), static_cast<int>(options->scene.views_test),
                static_cast<int>(options->scene.width), static_cast<int>(options->scene.height));
    return success;
  };
}

}  // namespace tool
