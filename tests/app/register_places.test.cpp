// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Splats that came without cameras, and nobody says which way is up: their pictures are found, and their marks read.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/app/informed.hpp>
#include <compmark/app/register.hpp>
#include <compmark/app/spread.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/splat_ply.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"
#include "upright_splats.hpp"

namespace register_places_test {
namespace {

using namespace compmark;
namespace fs = std::filesystem;
using Direction = std::array<double, 3>;

constexpr int side = 128;

/// A scene with z up in a file that does not say so, the same with a spread mark, and three photographers.
struct UprightFiles {
  testing::ScratchFolder folder{"compmark-app-register-places"};
  fs::path plain = folder.path / "plain.ply", marked = folder.path / "marked.safetensors";
  ThreadExecutor executor{2};
  OwnerKey key = testing::small_key(1, 32);
  std::vector<Camera<double>> cameras{testing::upright_camera(25, 18, 3.4, side),
                                      testing::upright_camera(145, 35, 3.8, side),
                                      testing::upright_camera(262, 27, 3.2, side)};

  UprightFiles() { REQUIRE(write_splat_ply(plain, testing::upright_splats(3000)).ok()); }
  std::vector<float> picture(AnyModel& model, const Camera<double>& camera) {
    const Result<RenderedView> render = model.render(camera, executor);
    REQUIRE(render.ok());
    std::vector<float> pixels(render->image.data, render->image.data + render->image.size());
    for (float& x : pixels) x = std::round(255 * std::clamp(x, 0.0f, 1.0f)) / 255;
    return pixels;
  }
};

/// Where two cameras put points of the scene, in the median, pixels.
double apart(const Camera<double>& a, const Camera<double>& b) {
  std::vector<double> all;
  for (int k = 0; k < 27; ++k) {
    const Direction point{0.5 * (k % 3 - 1), 0.4 * (k / 3 % 3 - 1), 0.4 * (k / 9 - 1)};
    const auto pixel = [&](const Camera<double>& camera) {
      Direction p{};
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c)
          p[r] += camera.rotation_camera_world[3 * r + c] * (point[c] - camera.center_world[c]);
      }
      return std::array<double, 2>{camera.fx * p[0] / p[2] + camera.cx, camera.fy * p[1] / p[2] + camera.cy};
    };
    all.push_back(std::hypot(pixel(a)[0] - pixel(b)[0], pixel(a)[1] - pixel(b)[1]));
  }
  std::sort(all.begin(), all.end());
  return all[all.size() / 2];
}

}  // namespace

TEST_CASE(
    "app/register_places: pictures of splats are found whichever way is up, if nobody says it; not if it is said "
    "wrongly") {
  UprightFiles files;
  Result<AnyModel> model = AnyModel::open(files.plain, files.executor);
  REQUIRE(model.ok());
  CHECK_FALSE(model->info().up.has_value());
  const auto right = [&](const std::optional<Direction>& up, std::size_t expected) {
    RegisterSettings settings;
    settings.up = up;
    const Result<std::vector<SearchPlace>> places = register_places(*model, settings, files.executor);
    REQUIRE(places.ok());
    CHECK(places->size() == expected);
    int count = 0;
    for (const Camera<double>& camera : files.cameras) {
      const std::vector<float> pixels = files.picture(*model, camera);
      const Result<Registration> found =
          register_picture(*model, *places, {pixels.data(), 3, side, side}, settings, files.executor);
      REQUIRE(found.ok());
      MESSAGE("likeness ", found->likeness, ", ", apart(found->camera, camera), " pixels off");
      const bool near = apart(found->camera, camera) < 0.5;
      CHECK(found->found == near);
      if (near) CHECK(found->likeness > 0.95);
      count += near && found->found;
    }
    return count;
  };
  CHECK(right({}, 600) == 3);
  CHECK(right(Direction{0, 0, 2}, 300) == 3);  // its length does not matter
  CHECK(right(usual_up, 300) == 0);
  // A file that says it is believed.
  const std::vector<std::string> comments{splat_up_comment({0, 0, 1})};
  REQUIRE(write_splat_ply(files.folder.path / "told.ply", testing::upright_splats(3000), comments).ok());
  model = AnyModel::open(files.folder.path / "told.ply", files.executor);
  REQUIRE(model.ok());
  CHECK(model->info().up == Direction{0, 0, 1});
  CHECK(right({}, 300) == 3);
  // … also as a model of ours.
  REQUIRE(model->write(files.folder.path / "told.safetensors").ok());
  model = AnyModel::open(files.folder.path / "told.safetensors", files.executor);
  REQUIRE(model.ok());
  CHECK(model->info().up == Direction{0, 0, 1});

  // No direction, and a model that needs none.
  RegisterSettings wrong;
  wrong.up = Direction{0, 0, 0};
  const Result<std::vector<SearchPlace>> none = register_places(*model, wrong, files.executor);
  REQUIRE_FALSE(none.ok());
  CHECK(none.error().field == "--up");
  const fs::path trained = files.folder.path / "trained.safetensors";
  REQUIRE(write_model(trained, testing::small_model<recipes::Scaffold>(5), testing::small_info("scaffold")).ok());
  Result<AnyModel> other = AnyModel::open(trained, files.executor);
  REQUIRE(other.ok());
  wrong.up = Direction{0, 0, 1};
  const Result<std::vector<SearchPlace>> refused = register_places(*other, wrong, files.executor);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().problem.find("cameras of its own") != std::string::npos);
}

TEST_CASE("app/register_places: a spread mark of splats is read though nobody says which way is up") {
  UprightFiles files;
  SpreadMarkSettings mark;
  mark.model = files.plain;
  mark.out = files.marked;
  mark.psnr = 42;
  REQUIRE(mark_spread(files.key, mark, files.executor).ok());
  Result<AnyModel> marked = AnyModel::open(files.marked, files.executor);
  REQUIRE(marked.ok());
  ReadingSettings reading;
  reading.unmarked = files.plain;
  reading.decoder = files.folder.path / "decoder.safetensors";
  testing::write_decoder(reading.decoder, 32);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::vector<float> pixels = files.picture(*marked, files.cameras[i]);
    const fs::path path = files.folder.path / (std::to_string(i) + ".png");
    REQUIRE(write_png(path, ImageView<const float>{pixels.data(), 3, side, side}).ok());
    reading.images.push_back(path);
  }
  const auto read = [&](const OwnerKey& whose, const std::optional<Direction>& up) {
    reading.up = up;
    const Result<InformedReport> report = verify_informed(whose, reading, VerifySettings{}, files.executor);
    REQUIRE(report.ok());
    MESSAGE(report->spread.deviations, " deviations");
    for (const InformedPicture& picture : report->pictures) MESSAGE(picture.likeness, " ", picture.spread.deviations);
    return report->together.verdict;
  };
  CHECK(read(files.key, {}) == Verdict::detected);
  CHECK(read(files.key, Direction{0, 0, 1}) == Verdict::detected);
  CHECK(read(testing::small_key(2, 32), {}) != Verdict::detected);
  CHECK(read(files.key, usual_up) != Verdict::detected);  // as everything was read before
}

}  // namespace register_places_test
