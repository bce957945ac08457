// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/dataset_views.hpp>
#include <compmark/splat/training/training_views.hpp>
#include <cstddef>
#include <vector>

#include "small_scene_models.hpp"

TEST_CASE("app/dataset_views: a choice of a dataset's views trains, and each is the view of its index") {
  using namespace compmark;
  static_assert(TrainingViews<DatasetViews, float>);
  const testing::SmallScene scene("compmark-app-views");
  const DatasetSettings settings;
  Result<Dataset> dataset = open_dataset(scene.data, settings);
  REQUIRE(dataset.ok());
  ImageStore store(*dataset, settings);
  DatasetViews views{&*dataset, &store, dataset->indices(Split::test)};
  REQUIRE(views.size() == 2);
  std::vector<float> chosen(3 * 48 * 48), direct(chosen.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const View& view = dataset->views[views.index[i]];
    CHECK(view.split == Split::test);
    CHECK(views.camera(i).center_world == view.camera.center_world);
    REQUIRE(views.load(i, {chosen.data(), 3, 48, 48}).ok());
    REQUIRE(store.load(view, {direct.data(), 3, 48, 48}).ok());
    CHECK(chosen == direct);
  }
  dataset->views[views.index[0]].lens.model = LensModel::opencv;
  dataset->views[views.index[0]].lens.parameters[0] = 0.1;
  CHECK(is_pinhole(views.lens(0)));  // undistorted, or ignored
  dataset->views[views.index[0]].lens_treatment = LensTreatment::keep;
  CHECK(views.lens(0).model == LensModel::opencv);
}
