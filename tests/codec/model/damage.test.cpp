// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Damage of models and checkpoints: an error, or nothing that is read is another.
#include <doctest/doctest.h>

#include <compmark/core/executor.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <filesystem>

#include "support/damage.hpp"
#include "support/small_scene.hpp"
#include "support/tool.hpp"

using namespace compmark;

TEST_CASE("model/damage: of models and checkpoints no damage is accepted as another") {
  using compmark::testing::FileBytes;
  using R = compmark::testing::SmallRecipe;
  using Run = Trainer<R, SerialExecutor>;
  TrainSettings settings;
  settings.iterations = 300;
  settings.voxel_size = 0.3;
  settings.statistics_after = 0;
  settings.grow_after = 1000;
  SerialExecutor executor;
  const compmark::testing::BlobViews views{3, 16, 16};
  Run trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(compmark::testing::cloud(40, 1)).ok());
  for (int i = 0; i < 3; ++i) REQUIRE(trainer.step(views).ok());
  ModelInfo info{"small", "scaffold", 300, 77, {}, {}};
  for (std::size_t i = 0; i < views.size(); ++i) info.views.push_back({"view", i == 2, views.camera(i)});
  info.views[1].lens = {LensModel::opencv, {0.1, -0.2, 1e-3, 0.3}};

  const compmark::testing::ScratchFolder folder("compmark-damage-test");
  const std::filesystem::path path = folder.path / "file.safetensors";
  REQUIRE(write_model(path, trainer.state().model, info).ok());
  compmark::testing::check_tensor_damage(
      "a model", *read_file(path),
      [](const SafetensorsFile& file, const FileBytes&) { return model_from<R>(file).ok(); });
  REQUIRE(write_checkpoint(path, trainer.state(), settings, info, 12.5).ok());
  const std::filesystem::path bad = folder.path / "bad.safetensors";
  compmark::testing::check_tensor_damage("a checkpoint", *read_file(path),
                                         [&](const SafetensorsFile& file, const FileBytes& bytes) {
                                           compmark::testing::put_raw(bad, bytes);
                                           return file.metadata.contains("settings") &&
                                                  read_checkpoint<Trainer<R, SerialExecutor>>(bad, settings, info).ok();
                                         });
}
