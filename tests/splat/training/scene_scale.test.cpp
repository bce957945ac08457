// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One small scene in other units, and captures of one and two images, as readers finish them and the trainer takes them.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/io/sha256.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/extent.hpp>
#include <compmark/scene/finish.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <span>
#include <string>
#include <vector>

#include "scene/cube_dialects.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using namespace compmark::testing;

/// The built-in scene, of radius 1.3, from these cameras, on black.
std::vector<std::vector<float>> photographs_of(const CubeCapture& capture) {
  std::vector<std::vector<float>> images;
  SerialExecutor executor;
  const ProceduralScene scene(0);
  for (const Camera<double>& camera : capture.cameras) {
    const ImageBytes rgba = render_procedural(scene, camera, executor);
    const std::size_t pixels = rgba.pixels.size() / 4;
    std::vector<float> image(3 * pixels);
    for (std::size_t p = 0; p < pixels; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        const int value = rgba.pixels[4 * p + c] * rgba.pixels[4 * p + 3];
        image[c * pixels + p] = static_cast<float>(value) / (255.0f * 255.0f);
      }
    }
    images.push_back(std::move(image));
  }
  return images;
}
const std::vector<std::vector<float>>& cube_photographs() {
  static const std::vector<std::vector<float>> images = photographs_of(cube_capture());
  return images;
}

/// What a reader makes of the scene in units that make it `scale` times as large; points on a grid through the built-in scene.
Dataset capture_at(double scale, int count = 12) {
  const CubeCapture capture = cube_capture(scale, {0, 0, 0}, count);
  Dataset dataset;
  for (const Camera<double>& camera : capture.cameras) {
    View view;
    view.camera = camera;
    dataset.views.push_back(view);
  }
  PrecisePoints points;
  for (int i = 0; i < 343; ++i) {
    points.position.push_back(
        {scale * (0.3 * (i % 7) - 0.9), scale * (0.3 * (i / 7 % 7) - 0.9), scale * (0.3 * (i / 49) - 0.9)});
    points.color.push_back({127, 127, 127});
  }
  detail::finish_dataset(dataset, std::move(points), {});
  return dataset;
}

struct Photographs {
  const Dataset* dataset;
  std::vector<std::size_t> index = dataset->indices(Split::train);
  [[nodiscard]] std::size_t size() const { return index.size(); }
  [[nodiscard]] Camera<double> camera(std::size_t i) const { return dataset->views[index[i]].camera; }
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<float> image) const {
    std::copy(cube_photographs()[index[i]].begin(), cube_photographs()[index[i]].end(), image.data);
    return Done{};
  }
};

struct TrainedScene {
  std::string hash;            ///< of all parameters
  double first = 0, last = 0;  ///< loss, mean of the first and the last twelve iterations
  double psnr = 0;             ///< over the training views
  double contrast = 0;         ///< largest difference of two values of a render
  double moved = 0;            ///< largest difference of an offset from its start
};
TrainedScene train(const Dataset& dataset, double extent, std::int64_t iterations) {
  TrainSettings settings;  // near plane, voxel size, volume loss and rates are the published ones
  settings.iterations = iterations;
  SerialExecutor executor;
  Photographs views{&dataset};
  Trainer<SmallRecipe, SerialExecutor> trainer(settings, views.size(), extent, executor);
  REQUIRE(trainer.initialise(dataset.points.position).ok());
  TrainedScene result;
  for (std::int64_t t = 0; t < iterations; ++t) {
    const auto report = trainer.step(views);
    REQUIRE(report.ok());
    (t < 12 ? result.first : result.last) += t < 12 || t >= iterations - 12 ? report->loss.total / 12 : 0;
  }
  Sha256 hash;
  hash.update(std::as_bytes(trainer.model().arena.all_values()));
  result.hash = hash.hex();
  const AnchorColumns<const float> columns = trainer.model().columns();
  for (std::size_t i = 0; i < columns.offset.size(); ++i)
    result.moved = std::max(result.moved, static_cast<double>(std::abs(columns.offset.data[i])));
  Pipeline<SmallRecipe>::Context context;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Camera<double> camera = views.camera(i);
    static_cast<void>(Pipeline<SmallRecipe>{}.forward(trainer.model(), camera, unseen_view, context, executor));
    const std::span<const float> image = context.image.flat();
    double square = 0;
    for (std::size_t k = 0; k < image.size(); ++k) {
      const double d = static_cast<double>(image[k] - cube_photographs()[views.index[i]][k]);
      square += d * d / static_cast<double>(image.size());
    }
    result.psnr += psnr_from_mse(square) / static_cast<double>(views.size());
    const auto [low, high] = std::minmax_element(image.begin(), image.end());
    result.contrast = std::max(result.contrast, static_cast<double>(*high - *low));
  }
  MESSAGE("unit ", dataset.unit, " extent ", extent, ": loss ", result.first, " to ", result.last, ", PSNR ",
          result.psnr, ", contrast ", result.contrast, ", offsets moved by ", result.moved, ", anchors ",
          columns.rows());
  return result;
}
TrainedScene train(const Dataset& dataset, std::int64_t iterations = 240) {
  return train(dataset, scene_extent(dataset).radius, iterations);
}

}  // namespace

TEST_CASE(
    "training/scene_scale: a scene in millimetres or kilometres trains to the scene in metres, to the bit (case PR8)") {
  const TrainedScene plain = train(capture_at(1));
  CHECK(plain.psnr > 20);
  for (const double scale : {0x1p-10, 0x1p+10}) {
    CAPTURE(scale);
    const Dataset dataset = capture_at(scale);
    CHECK(dataset.unit == scale);
    CHECK(train(dataset).hash == plain.hash);
  }
  // A factor that is no power of two: the roundings of doubles, and lengths 1.024 as large.
  const TrainedScene thousandth = train(capture_at(1e-3));
  CHECK(thousandth.hash != plain.hash);
  CHECK(std::abs(thousandth.psnr - plain.psnr) < 1);

  // The control: in their own units the small one lies before the near plane, a constant image, and the large one is all volume loss.
  for (const double scale : {0x1p-10, 0x1p+10}) {
    Dataset dataset = capture_at(scale);
    change_unit(dataset, 1);
    const TrainedScene lost = train(dataset);
    CHECK(lost.psnr < plain.psnr - 8);
    if (scale < 1) CHECK(lost.contrast == 0);
  }
}

TEST_CASE("training/scene_scale: captures of one and two images train, offsets too") {
  for (const int count : {1, 2}) {
    CAPTURE(count);
    const Dataset dataset = capture_at(1, count);
    const TrainedScene trained = train(dataset);
    CHECK(trained.last < 0.5 * trained.first);
    CHECK(trained.moved > 0.1);
    // As readers split two images: one trains.
    Dataset split = dataset;
    split.views[0].split = count == 2 ? Split::test : Split::train;
    CHECK(train(split, 60).moved > 0.1);
    // The control: the published extent of one place.
    CHECK(camera_extent(split).radius == 0);
    CHECK(train(split, camera_extent(split).radius, 60).moved == 0);
  }
}
