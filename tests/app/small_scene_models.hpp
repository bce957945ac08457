// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A dataset of a few small photographs, and models that store its cameras.
#pragma once

#include <doctest/doctest.h>

#include <compmark/app/capture.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstdint>
#include <filesystem>
#include <string>

#include "small_models.hpp"
#include "support/tool.hpp"

namespace compmark::testing {

/// Three views of the training and two of the test, 48 x 48.
struct SmallScene {
  ScratchFolder folder;
  std::filesystem::path data = folder.path / "scene";

  explicit SmallScene(const std::string& name) : folder(name) {
    ProceduralSettings scene;
    scene.width = scene.height = 48;
    scene.views_train = 3;
    scene.views_test = 2;
    REQUIRE(write_procedural_scene(data, scene).ok());
  }
  /// A model of seed `seed`, with black behind it.
  template <class R>
  std::filesystem::path write(const std::string& name, const std::string& recipe, std::uint64_t seed) const {
    Model<R> model = small_model<R>(seed);
    model.render.background = {0, 0, 0};
    ModelInfo info = small_info(recipe);
    info.views.clear();
    const Result<Dataset> dataset = open_dataset(data, DatasetSettings{});
    REQUIRE(dataset.ok());
    for (const View& view : dataset->views) info.views.push_back(stored_view(view));
    REQUIRE(write_model(folder.path / name, model, info).ok());
    return folder.path / name;
  }
};

}  // namespace compmark::testing
