// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark scene: writes the built-in scene, so that everything can be tried without any data.
#include <compmark/scene/procedural_write.hpp>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "common.hpp"

namespace tool {

Command add_scene(CLI::App& app) {
  struct Options {
    std::filesystem::path out;
    compmark::ProceduralSettings scene;
  };
  auto options = std::make_shared<Options>();
  app.add_option("--out", options->out, "folder to write (Blender format: transforms_*.json and PNG images)")
      ->required();
  app.add_option("--width", options->scene.width, "pixels")->capture_default_str()->check(CLI::Range(8, 4096));
  app.add_option("--height", options->scene.height, "pixels")->capture_default_str()->check(CLI::Range(8, 4096));
  app.add_option("--train", options->scene.views_train, "training views")
      ->capture_default_str()
      ->check(CLI::Range(1, 10000));
  app.add_option("--test", options->scene.views_test, "test views")->capture_default_str()->check(CLI::Range(0, 10000));
  app.add_option("--seed", options->scene.seed, "seed of camera positions and textures")->capture_default_str();
  return [options]() -> int {
    if (auto folder = make_folder(options->out); !folder) return fail(folder.error());
    if (auto written = compmark::write_procedural_scene(options->out, options->scene); !written)
      return fail(written.error());
    std::printf("%s: %d training and %d test views of %d x %d pixels\n", options->out.string().c_str(),
                static_cast<int>(options->scene.views_train), static_cast<int>(options->scene.views_test),
                static_cast<int>(options->scene.width), static_cast<int>(options->scene.height));
    return success;
  };
}

}  // namespace tool
