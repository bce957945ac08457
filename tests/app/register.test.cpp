// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/app/register.hpp>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "small_models.hpp"
#include "support/tool.hpp"

namespace register_test {
namespace {

using namespace compmark;

/// A small model on disk, opened, and a picture from a camera that it does not store.
struct RegisterFiles {
  testing::ScratchFolder folder{"compmark-app-register"};
  std::filesystem::path file = folder.path / "model.safetensors";
  ThreadExecutor executor{2};
  RegisterSettings settings;
  Camera<double> truth;

  RegisterFiles() {
    Model<recipes::Scaffold> model = testing::small_model<recipes::Scaffold>(5);
    model.render.background = {0, 0, 0};
    REQUIRE(write_model(file, model, testing::small_info("scaffold")).ok());
    settings.places = 40;
    truth = testing::small_info("scaffold").views[0].camera;
    truth = moved(truth, {0.03, -0.02, 0.1, 0.05, 0.02, 0.04, 0, 0, 0}).resized(100, 80);
  }
  std::vector<float> picture(AnyModel& model) {
    const Result<RenderedView> render = model.render(truth, executor);
    REQUIRE(render.ok());
    return {render->image.data, render->image.data + render->image.size()};
  }
  /// Where two cameras put the middle and two points about it, largest distance in pixels.
  static double apart(const Camera<double>& a, const Camera<double>& b) {
    double most = 0;
    for (int k = 0; k < 9; ++k) {
      const std::array<double, 3> point{0.3 * (k % 3 - 1), 0.3 * (k / 3 - 1), 0.2 * (k % 2)};
      const auto pixel = [&](const Camera<double>& camera) {
        std::array<double, 3> p{};
        for (std::size_t r = 0; r < 3; ++r) {
          for (std::size_t c = 0; c < 3; ++c)
            p[r] += camera.rotation_camera_world[3 * r + c] * (point[c] - camera.center_world[c]);
        }
        return std::array<double, 2>{camera.fx * p[0] / p[2] + camera.cx, camera.fy * p[1] / p[2] + camera.cy};
      };
      most = std::max(most, std::hypot(pixel(a)[0] - pixel(b)[0], pixel(a)[1] - pixel(b)[1]));
    }
    return most;
  }
};

/// A model whose renders fail from call `first` on, `count` of them; the calls are counted from 0.
class FailingModel final : public detail::HeldModel {
 public:
  FailingModel(AnyModel inner, std::size_t& calls, std::size_t first, std::size_t count)
      : inner_(std::move(inner)),
        calls_(&calls),
        first_(first),
        count_(count) {
    info = inner_.info();
  }
  Result<RenderedView> render(const Camera<double>& camera, const Lens& lens, ThreadExecutor& executor) override {
    const std::size_t call = (*calls_)++;
    if (call >= first_ && call - first_ < count_)
      return Error{ErrorKind::exhausted, "", "raster.pair_budget", "one view needs too many", "render less"};
    return inner_.render(camera, lens, executor);
  }
  Result<MatrixView<const float>> feature_gradient(const Camera<double>& camera, const Lens& lens,
                                                   ImageView<const float> d_image, ThreadExecutor& executor) override {
    return inner_.feature_gradient(camera, lens, d_image, executor);
  }
  Result<GaussianShares> shares(const Camera<double>& camera, const Lens& lens, ThreadExecutor& executor) override {
    return detail::HeldAccess::held(inner_).shares(camera, lens, executor);
  }
  ParameterArena<float>& arena() override { return inner_.arena(); }
  [[nodiscard]] std::size_t anchor_count() const override { return inner_.anchor_count(); }
  [[nodiscard]] RenderSettings render_settings() const override { return inner_.render_settings(); }
  [[nodiscard]] Result<Done> write(const std::filesystem::path& path) const override { return inner_.write(path); }
  [[nodiscard]] Result<CodecModel> coded(const CodedModelSettings& settings) const override {
    return inner_.coded(settings);
  }

 private:
  AnyModel inner_;
  std::size_t* calls_;
  std::size_t first_, count_;
};

}  // namespace

TEST_CASE("a picture of a model is registered to a hundredth of a pixel, mirrored or in another tone too") {
  RegisterFiles files;
  Result<AnyModel> model = AnyModel::open(files.file, files.executor);
  REQUIRE(model.ok());
  const Result<std::vector<SearchPlace>> places = register_places(*model, files.settings, files.executor);
  REQUIRE(places.ok());
  CHECK(places->size() == 40);
  std::vector<float> values = files.picture(*model);
  const ImageView<float> view{values.data(), 3, 80, 100};
  const Result<Registration> found = register_picture(*model, *places, view, files.settings, files.executor);
  REQUIRE(found.ok());
  CHECK(found->found);
  CHECK(!found->mirrored);
  CHECK(RegisterFiles::apart(found->camera, files.truth) < 0.01);
  CHECK(found->uncertainty_pixels < 0.05);
  CHECK(found->weight.size() == 100 * 80);
  ThreadExecutor alone(1);
  const Result<Registration> same = register_picture(*model, *places, view, files.settings, alone);
  REQUIRE(same.ok());
  CHECK(same->camera.center_world == found->camera.center_world);
  CHECK(same->camera.rotation_camera_world == found->camera.rotation_camera_world);

  for (float& value : values) value = std::pow(0.9f * value, 1.2f) + 0.02f;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 80; ++y) std::reverse(view.row(c, y), view.row(c, y) + 100);
  }
  RegisterSettings both = files.settings;
  both.mirrored = true;
  const Result<Registration> turned = register_picture(*model, *places, view, both, files.executor);
  REQUIRE(turned.ok());
  CHECK(turned->found);
  CHECK(turned->mirrored);
  CHECK(RegisterFiles::apart(turned->camera, files.truth) < 0.3);
}

TEST_CASE("the uncertainty of a camera is what noise scatters it by") {
  RegisterFiles files;
  Result<AnyModel> model = AnyModel::open(files.file, files.executor);
  REQUIRE(model.ok());
  const Result<std::vector<SearchPlace>> places = register_places(*model, files.settings, files.executor);
  REQUIRE(places.ok());
  const std::vector<float> clean = files.picture(*model);
  double square = 0, said = 0;
  constexpr std::uint64_t draws = 8;
  for (std::uint64_t draw = 0; draw < draws; ++draw) {
    std::vector<float> values = clean;
    const Random random(draw, 0, random_stage("test/register noise"));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += static_cast<float>(0.05 * random.normal(i));
    const Result<Registration> found = register_picture(
        *model, *places, ImageView<const float>{values.data(), 3, 80, 100}, files.settings, files.executor);
    REQUIRE(found.ok());
    REQUIRE(found->found);
    const double apart = RegisterFiles::apart(found->camera, files.truth);
    square += apart * apart / draws;
    said += found->uncertainty_pixels / draws;
  }
  MESSAGE("scattered by ", std::sqrt(square), " pixels, said ", said);
  // The largest of nine points' distances against the mean over the Gaussians in view: 0.028 and 0.035 were measured.
  CHECK(std::sqrt(square) < 2.5 * said);
  CHECK(std::sqrt(square) > said / 2.5);
}

TEST_CASE(
    "where the last steps of a fit are not drawn the camera is looked at again, and what is never drawn is an error") {
  RegisterFiles files;
  Result<AnyModel> model = AnyModel::open(files.file, files.executor);
  REQUIRE(model.ok());
  const Result<std::vector<SearchPlace>> places = register_places(*model, files.settings, files.executor);
  REQUIRE(places.ok());
  const std::vector<float> values = files.picture(*model);
  const ImageView<const float> view{values.data(), 3, 80, 100};
  struct Run {
    Result<Registration> found;
    std::size_t calls;
  };
  const auto with_failing = [&](std::size_t first, std::size_t count) {
    Result<AnyModel> inner = AnyModel::open(files.file, files.executor);
    REQUIRE(inner.ok());
    std::size_t calls = 0;
    AnyModel failing =
        detail::HeldAccess::made(std::make_unique<FailingModel>(std::move(*inner), calls, first, count), files.file, 0);
    Result<Registration> found = register_picture(failing, *places, view, files.settings, files.executor);
    return Run{std::move(found), calls};
  };
  constexpr std::size_t all = std::size_t{1} << 40;
  const Run whole = with_failing(all, 0);
  REQUIRE(whole.found.ok());
  REQUIRE(whole.found->found);
  REQUIRE(whole.calls > 10);
  for (const std::size_t first : {std::size_t{0}, whole.calls / 2}) {
    CAPTURE(first);
    const Run never = with_failing(first, all);
    REQUIRE_FALSE(never.found.ok());
    CHECK(never.found.error().field == "raster.pair_budget");
  }
  // From the last step on: the fit gives up on it, and the camera that it keeps is looked at once more, for what it sees.
  const std::size_t last = whole.calls - 1;
  const Run never = with_failing(last, all);
  REQUIRE_FALSE(never.found.ok());
  CHECK(never.found.error().field == "raster.pair_budget");
  const std::size_t failed = never.calls - last;
  MESSAGE(whole.calls, " renders, ", failed, " failed at the end");
  REQUIRE(failed >= 2);
  const Run again = with_failing(last, failed - 1);
  REQUIRE(again.found.ok());
  CHECK(again.calls == never.calls);
  CHECK(again.found->found);
  CHECK(RegisterFiles::apart(again.found->camera, files.truth) < 0.05);
  CHECK(again.found->uncertainty_pixels < 0.05);  // without another look it would be infinite
}

TEST_CASE("a picture of something else is not found, and one that is too small is refused") {
  RegisterFiles files;
  Result<AnyModel> model = AnyModel::open(files.file, files.executor);
  REQUIRE(model.ok());
  const Result<std::vector<SearchPlace>> places = register_places(*model, files.settings, files.executor);
  REQUIRE(places.ok());
  std::vector<float> noise(3 * 64 * 64);
  const Random random(3, 0, random_stage("test/register"));
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<float>(random.uniform(i / 4));
  const Result<Registration> other = register_picture(*model, *places, ImageView<const float>{noise.data(), 3, 64, 64},
                                                      files.settings, files.executor);
  REQUIRE(other.ok());
  CHECK(!other->found);
  // One colour is like nothing, at sizes that shrink to odd ones too.
  for (const auto& [width, height] : {std::pair(63, 51), std::pair(100, 80)}) {
    const std::vector<float> flat(static_cast<std::size_t>(3 * width * height), 0.5f);
    const Result<Registration> none = register_picture(
        *model, *places, ImageView<const float>{flat.data(), 3, height, width}, files.settings, files.executor);
    REQUIRE(none.ok());
    CHECK(!none->found);
    CHECK(none->weight.empty());
  }
  const Result<Registration> small = register_picture(*model, *places, ImageView<const float>{noise.data(), 3, 31, 64},
                                                      files.settings, files.executor);
  REQUIRE(!small.ok());
  CHECK(small.error().field == "size");
}

}  // namespace register_test
