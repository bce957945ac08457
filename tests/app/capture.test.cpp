// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/capture.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <cstddef>

#include "support/tool.hpp"

using namespace compmark;

TEST_CASE("app/capture: a dataset is opened as it was for the model: its lens, its unit, and where it lies") {
  ModelInfo info;
  info.recipe = "scaffold";
  CHECK(settings_of(info).lens == DatasetSettings{}.lens);
  info.recipe = "scaffold+fisheye";
  CHECK(settings_of(info).lens == LensTreatment::keep);
  info.effects = {lens_ignored};
  CHECK(settings_of(info).lens == LensTreatment::ignore);

  const testing::ScratchFolder folder("compmark-app-capture");
  ProceduralSettings scene;
  scene.width = scene.height = 32;
  scene.views_train = 3;
  scene.views_test = 1;
  REQUIRE(write_procedural_scene(folder.path, scene).ok());
  const Result<Dataset> plain = open_dataset(folder.path, DatasetSettings{});
  REQUIRE(plain.ok());
  info = {};
  info.recipe = "scaffold";
  info.unit = 2;
  info.origin = {0.5, -1, 0.25};
  ThreadExecutor executor(1);
  const Result<Dataset> moved = open_for(info, folder.path, DatasetSettings{}, executor);
  REQUIRE(moved.ok());
  CHECK(moved->unit == 2);
  CHECK(moved->origin == info.origin);
  for (std::size_t i = 0; i < plain->views.size(); ++i) {
    const auto &a = plain->views[i].camera.center_world, &b = moved->views[i].camera.center_world;
    for (std::size_t axis = 0; axis < 3; ++axis)  // the same place, in the files' coordinates
      CHECK(info.unit * b[axis] + info.origin[axis] == doctest::Approx(plain->unit * a[axis] + plain->origin[axis]));
  }
  const StoredView stored = stored_view(plain->views[0]);
  CHECK(stored.name == plain->views[0].name);
  CHECK(stored.test == (plain->views[0].split == Split::test));
  CHECK(is_pinhole(stored.lens));
}
