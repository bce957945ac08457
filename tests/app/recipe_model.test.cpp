// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/app/recipe_model.hpp>
#include <compmark/splat/export/explicit_splats.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <type_traits>

#include "small_models.hpp"
#include "support/tool.hpp"

TEST_CASE("app/recipe_model: the model that is held is handed over by its own type, not a copy of it") {
  using namespace compmark;
  const testing::ScratchFolder folder("compmark-app-typed");
  ThreadExecutor executor(1);
  const std::filesystem::path path = folder.path / "model.safetensors";
  REQUIRE(write_model(path, testing::small_model<recipes::HacScaffold>(), testing::small_info("hac+mask")).ok());
  Result<AnyModel> model = AnyModel::open(path, executor);
  REQUIRE(model.ok());
  const Result<int> features = with_model(*model, [](auto& typed) -> Result<int> {
    typed.arena.all_values()[0] = 7;
    return static_cast<int>(typed.columns().feature.columns);
  });
  REQUIRE(features.ok());
  CHECK(*features == 50);
  CHECK(model->arena().all_values()[0] == 7);
  const Result<Done> refused = with_model(*model, [](auto&) -> Result<Done> {
    return Error{ErrorKind::invalid, {}, {}, "not this one", {}};
  });
  CHECK(refused.error().problem == "not this one");
}

TEST_CASE(
    "app/recipe_model: a view that shows more than there is memory for is an error, not a picture of the background") {
  using namespace compmark;
  ThreadExecutor executor(2);
  const auto centre_of = [&](std::size_t count) -> Result<float> {
    SplatTable splats;  // each covers the whole image of 65,536 tiles: 2^28 pairs are 4,096 of them
    splats.resize(count, 0);
    for (std::size_t i = 0; i < count; ++i) {
      splats.mean[2][i] = 3 + 1e-4f * static_cast<float>(i);
      splats.rotation[0][i] = 1;
      for (std::size_t k = 0; k < 3; ++k) {
        splats.log_scale[k][i] = 2;
        splats.color(k, 0)[i] = 1;
      }
    }
    Result<Model<recipes::Explicit>> model = model_from_splats<recipes::Explicit>(splats);
    REQUIRE(model.ok());
    detail::RecipeModel<recipes::Explicit> held(LoadedModel<recipes::Explicit>{std::move(*model), {}});
    Camera<double> camera;
    camera.width = camera.height = 4096;
    camera.fx = camera.fy = camera.cx = camera.cy = 2048;
    const Result<RenderedView> view = held.render(camera, Lens{}, executor);
    if (!view) return view.error();
    return view->image(0, 2048, 2048);
  };
  const Result<float> few = centre_of(40);
  REQUIRE(few.ok());
  CHECK(*few > 0.5f);
  const Result<float> many = centre_of(4200);
  REQUIRE(!many.ok());
  CHECK(many.error().kind == ErrorKind::exhausted);
}
