// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/app/any_model.hpp>
#include <compmark/app/recipe_model.hpp>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/splat/training/pipeline.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "small_models.hpp"
#include "support/tool.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

std::vector<float> pixels(ImageView<const float> image) { return {image.data, image.data + image.size()}; }

/// What the pipeline of the recipe's own type renders.
template <class R>
std::vector<float> typed_render(const Model<R>& model, const Camera<double>& camera, ThreadExecutor& executor) {
  const Pipeline<R> pipeline;
  typename Pipeline<R>::Context context;
  static_cast<void>(pipeline.forward(model, ViewCamera<R>(camera), unseen_view, context, executor));
  return pixels(context.image);
}

/// f(the model of this recipe).
template <class F>
void for_recipe(const std::string& name, const F& f) {
  const Result<Done> done = with_reading_recipe(name, OrError([&](auto tag) -> Result<Done> {
                                                  f(testing::small_model<typename decltype(tag)::Recipe>());
                                                  return Done{};
                                                }));
  REQUIRE(done.ok());
}

/// Of the pixels, how many are not the background.
std::size_t drawn(const std::vector<float>& image) {
  const std::size_t plane = image.size() / 3;
  std::size_t count = 0;
  for (std::size_t i = 0; i < plane; ++i)
    count += image[i] != 0.25f || image[plane + i] != 0.5f || image[2 * plane + i] != 1.0f;
  return count;
}

/// The .cmk of a model renders as the decoded model of its type does.
void check_compressed(const std::string& name, const AnyModel& trained, const fs::path& file,
                      ThreadExecutor& executor) {
  CodedModelSettings settings;
  settings.cameras = StoredCameras::all;
  const Result<CodecModel> coded = trained.coded(settings);
  if (!coded) FAIL(coded.error().line());
  REQUIRE(write_cmk(file, *coded, CodecEncodeSettings{}, executor).ok());
  Result<AnyModel> model = AnyModel::open(file, executor);
  if (!model) FAIL(model.error().line());
  CHECK(model->info().recipe == name);
  CHECK(model->file_bytes() == fs::file_size(file));
  REQUIRE(model->info().views.size() == testing::small_views);
  const Camera<double> camera = model->info().views[1].camera;
  const Result<RenderedView> render = model->render(camera, executor);
  REQUIRE(render.ok());
  const std::vector<float> seen = pixels(render->image);
  CHECK(drawn(seen) > seen.size() / 30);
  const Result<CodecDecoded> decoded = read_cmk(file, CodecDecodeSettings{}, executor);
  REQUIRE(decoded.ok());
  const Result<Done> compared =
      with_coded_reading_recipe(name, OrError([&](auto tag) -> Result<Done> {
                                  using R = typename decltype(tag)::Recipe;
                                  const Result<LoadedModel<R>> loaded = model_from<R>(decoded->model);
                                  REQUIRE(loaded.ok());
                                  CHECK(seen == typed_render(loaded->model, camera, executor));
                                  return Done{};
                                }));
  CHECK(compared.ok());
}

}  // namespace

TEST_CASE(
    "app/any_model: a model file of every recipe renders as the pipeline of its type does, to the bit, and so does its "
    ".cmk") {
  const testing::ScratchFolder folder("compmark-app-any");
  ThreadExecutor executor(2);
  std::size_t compressed = 0;
  for (const std::string name : testing::read_recipes) {
    CAPTURE(name);
    const fs::path path = folder.path / "model.safetensors";
    for_recipe(name, [&](const auto& made) {
      REQUIRE(write_model(path, made, testing::small_info(name)).ok());
      Result<AnyModel> model = AnyModel::open(path, executor);
      REQUIRE(model.ok());
      CHECK(model->info().recipe == name);
      CHECK(model->file() == path);
      CHECK(model->anchor_count() == testing::small_anchors);
      CHECK(model->file_bytes() == fs::file_size(path));
      CHECK(model->render_settings().background == made.render.background);
      for (const StoredView& view : model->info().views) {
        const Result<RenderedView> render = model->render(view, executor);
        REQUIRE(render.ok());
        const std::vector<float> seen = pixels(render->image);
        CHECK(seen == typed_render(made, view.camera, executor));
        CHECK(drawn(seen) > seen.size() / 30);  // not the background alone
        CHECK(render->gaussians > 0);
      }
      if (is_coded_recipe(name)) {
        check_compressed(name, *model, folder.path / "model.cmk", executor);
        ++compressed;
      }
    });
  }
  CHECK(compressed == 8);  // of both codecs
}

TEST_CASE("app/any_model: what training alone needs changes nothing of how a model is read") {
  const testing::ScratchFolder folder("compmark-app-mask");
  ThreadExecutor executor(1);
  const fs::path path = folder.path / "model.safetensors";
  const auto made = testing::small_model<recipes::Scaffold>();
  std::vector<float> plain;
  for (const std::string name : {"scaffold", "scaffold+mask", "scaffold+alpha"}) {
    CAPTURE(name);
    REQUIRE(write_model(path, made, testing::small_info(name)).ok());
    Result<AnyModel> model = AnyModel::open(path, executor);
    REQUIRE(model.ok());
    CHECK(model->info().recipe == name);
    const Result<RenderedView> render = model->render(model->info().views[0], executor);
    REQUIRE(render.ok());
    if (plain.empty()) plain = pixels(render->image);
    CHECK(pixels(render->image) == plain);
  }
}

TEST_CASE("app/any_model: what is changed in the arena is what is rendered and written") {
  const testing::ScratchFolder folder("compmark-app-write");
  ThreadExecutor executor(1);
  const fs::path path = folder.path / "a.safetensors", again = folder.path / "b.safetensors";
  const ModelInfo info = testing::small_info("scaffold");
  REQUIRE(write_model(path, testing::small_model<recipes::Scaffold>(), info).ok());
  Result<AnyModel> model = AnyModel::open(path, executor);
  REQUIRE(model.ok());
  REQUIRE(model->write(again).ok());
  CHECK(*read_file(path) == *read_file(again));
  const std::vector<float> before = pixels(model->render(info.views[0], executor)->image);
  for (float& x : model->arena().all_values()) x *= 0.75f;
  const std::vector<float> after = pixels(model->render(info.views[0], executor)->image);
  CHECK(before != after);
  REQUIRE(model->write(again).ok());
  Result<AnyModel> changed = AnyModel::open(again, executor);
  REQUIRE(changed.ok());
  CHECK(pixels(changed->render(info.views[0], executor)->image) == after);
}

TEST_CASE("app/any_model: a lens of another family than the model's is refused by name") {
  const testing::ScratchFolder folder("compmark-app-lens");
  ThreadExecutor executor(1);
  const fs::path path = folder.path / "model.safetensors";
  REQUIRE(write_model(path, testing::small_model<recipes::ScaffoldLens>(), testing::small_info("scaffold+lens")).ok());
  Result<AnyModel> model = AnyModel::open(path, executor);
  REQUIRE(model.ok());
  const Camera<double> camera = model->info().views[0].camera;
  Lens lens;
  lens.model = LensModel::opencv;
  lens.parameters[0] = 0.05;
  const std::vector<float> straight = pixels(model->render(camera, executor)->image);
  const Result<RenderedView> bent = model->render(camera, lens, executor);
  REQUIRE(bent.ok());
  CHECK(pixels(bent->image) != straight);
  lens.model = LensModel::opencv_fisheye;
  const Result<RenderedView> foreign = model->render(camera, lens, executor);
  REQUIRE_FALSE(foreign.ok());
  CHECK(foreign.error().field == "lens");
  CHECK(foreign.error().problem.find("scaffold+lens") != std::string::npos);
}

TEST_CASE("app/any_model: a file of another kind is named for what it is") {
  const testing::ScratchFolder folder("compmark-app-kinds");
  ThreadExecutor executor(1);
  const auto error_of = [&](const fs::path& path) {
    const Result<AnyModel> model = AnyModel::open(path, executor);
    REQUIRE_FALSE(model.ok());
    CHECK(model.error().line().find(path.string()) != std::string::npos);
    return model.error().line();
  };
  const fs::path picture = folder.path / "model.png";
  std::vector<float> grey(3 * 16, 0.5f);
  REQUIRE(write_png(picture, ImageView<const float>{grey.data(), 3, 4, 4}).ok());
  CHECK(error_of(picture).find("PNG") != std::string::npos);
  const fs::path ply = folder.path / "model.ply";
  REQUIRE(write_file(ply, std::string("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")).ok());
  CHECK(error_of(ply).find("x: is missing") != std::string::npos);  // a splat, and what it lacks
  CHECK(error_of(folder.path / "absent.cmk").find("no such file") != std::string::npos);

  // A model of a recipe that nobody ships, and one whose numbers are of another recipe than its name.
  const fs::path path = folder.path / "model.safetensors";
  const auto made = testing::small_model<recipes::Scaffold>();
  REQUIRE(write_model(path, made, testing::small_info("my-recipe")).ok());
  CHECK(error_of(path).find("unknown recipe \"my-recipe\"") != std::string::npos);
  REQUIRE(write_model(path, made, testing::small_info("compmark-host")).ok());
  CHECK(error_of(path).find("shape") != std::string::npos);
  // Control: the same file by its right name.
  REQUIRE(write_model(path, made, testing::small_info("scaffold")).ok());
  CHECK(AnyModel::open(path, executor).ok());
}

TEST_CASE("app/any_model: a model without an entropy model is not coded") {
  const testing::ScratchFolder folder("compmark-app-uncoded");
  ThreadExecutor executor(1);
  const fs::path path = folder.path / "model.safetensors";
  REQUIRE(write_model(path, testing::small_model<recipes::Scaffold>(), testing::small_info("scaffold")).ok());
  const Result<AnyModel> model = AnyModel::open(path, executor);
  REQUIRE(model.ok());
  const Result<CodecModel> coded = model->coded();
  REQUIRE_FALSE(coded.ok());
  CHECK(coded.error().kind == ErrorKind::unsupported);
  CHECK(coded.error().problem.find("\"scaffold\" has no entropy model") != std::string::npos);
}
