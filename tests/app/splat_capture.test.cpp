// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A splat file as a capture of itself: its cameras, its pictures and its points.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/any_model.hpp>
#include <compmark/app/capture.hpp>
#include <compmark/app/splat_capture.hpp>
#include <compmark/core/buffer.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <compmark/scene/splat_table.hpp>
#include <filesystem>
#include <set>
#include <string>

#include "io/splat_writers.hpp"
#include "support/damage.hpp"
#include "support/tool.hpp"

using namespace compmark;

namespace splat_capture_test {

namespace fs = std::filesystem;
namespace splats = compmark::testing::splats;

TEST_CASE("app/splat_capture: cameras round it, its renders as photographs, its places as points") {
  const testing::ScratchFolder folder("compmark-app-splat-capture");
  ThreadExecutor executor(2);
  SplatTable table = splats::random_splats(300, 2);
  table.opacity[7] = -4;  // hardly seen: no point to begin with
  const fs::path ply = folder.path / "scene.ply";
  testing::put_raw(ply, splats::permuted_ply_bytes(table, 1));
  DatasetSettings settings;
  settings.downscale = 10;
  const Result<Dataset> dataset = open_capture(ply, settings, executor);
  REQUIRE_MESSAGE(dataset.ok(), dataset.error().line());
  CHECK(dataset->kind == "splats");
  CHECK(dataset->views.size() == splat_views);
  CHECK(dataset->indices(Split::test).size() == splat_views / 8);
  CHECK(dataset->views[5].name == "around_005");
  CHECK(dataset->views[0].camera.width == splat_picture_size / 10);
  const auto seen = static_cast<std::size_t>(
      std::count_if(table.opacity.begin(), table.opacity.end(), [](float logit) { return logit >= 0; }));
  CHECK(dataset->points.size() == (seen == 0 ? table.count : seen));

  // A picture is the model's render in 8 bits, made once.
  ImageStore store(*dataset, settings);
  Result<AnyModel> model = AnyModel::open(ply, executor);
  REQUIRE(model.ok());
  const View& view = dataset->views[20];
  Buffer<float> pixels(3 * 80 * 80);
  REQUIRE(store.load(20, ImageView<float>{pixels.data(), 3, 80, 80}).ok());
  const Result<RenderedView> render = model->render(view.camera, executor);
  REQUIRE(render.ok());
  round_to_8bit<float>(render->image, render->image);
  CHECK(std::equal(pixels.data(), pixels.data() + pixels.size(), render->image.data));
  CHECK(*std::max_element(pixels.data(), pixels.data() + pixels.size()) > 0.2f);
  REQUIRE(store.load(20, ImageView<float>{pixels.data(), 3, 80, 80}).ok());
  CHECK(store.statistics().decoded == 1);
  CHECK(store.statistics().hits == 1);

  settings.background = {1, 1, 1};
  ImageStore white(*dataset, settings);
  const Result<const StoredImage*> refused = white.get(20);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "--background");
}

TEST_CASE("app/splat_capture: a folder is opened as ever, and what is no splat file is refused") {
  const testing::ScratchFolder folder("compmark-app-splat-capture-other");
  ThreadExecutor executor(1);
  ProceduralSettings scene;
  scene.width = scene.height = 32;
  scene.views_train = 3;
  scene.views_test = 1;
  REQUIRE(write_procedural_scene(folder.path / "scene", scene).ok());
  const Result<Dataset> dataset = open_capture(folder.path / "scene", {}, executor);
  REQUIRE(dataset.ok());
  CHECK(dataset->pictures == nullptr);
  CHECK(dataset->views.size() == 4);
  const fs::path text = folder.path / "notes.txt";
  testing::put_raw(text, std::as_bytes(std::span<const char>("nothing of that kind", 20)));
  CHECK_FALSE(open_capture(text, {}, executor).ok());
  CHECK_FALSE(open_splat_capture(text, {}, executor).ok());
  DatasetSettings settings;
  settings.downscale = 0;
  CHECK(open_splat_capture(text, settings, executor).error().field == "downscale");
}

}  // namespace splat_capture_test
