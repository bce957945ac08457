// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Coarse images first: what a coarse iteration sees is the box-filtered image of the fine one, and a run of both is a
// run like any other.
#include "compmark/splat/training/coarse_to_fine.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/raster/reference.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/coarse_images.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "support/growing_run.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;

struct CoarseRecipe : DefaultRecipe<float, compmark::testing::scene_shape> {};
using CoarseTrainer = Trainer<CoarseRecipe, SerialExecutor>;

/// Masks, coverage, a drawn background, exposures and a lens at once.
struct CoarseEffects : CoarseRecipe {
  using Rasterizer = EffectTileRasterizer<float, RasterEffects<RadialTangentialLens<float>>, accuracy::standard,
                                          RasterOutputs{.alpha = true, .screen_statistics = true}>;
  using Background = RandomBackground;
  using AlphaLoss = L1AlphaLoss<float>;
  using PixelWeights = MaskedPixels<float>;
  using Exposure = AffineExposure<float>;
};
struct CoarseEffectViews : BlobViews {
  [[nodiscard]] ViewCamera<CoarseEffects> camera(std::size_t i) const {
    return {BlobViews::camera(i),
            *lens_policy<RecipeLens<CoarseEffects>>(Lens{LensModel::opencv, {-0.1, 0.02, 0.001, -0.001}})};
  }
  [[nodiscard]] Result<Done> load_planes(std::size_t i, std::array<float, 3> background,
                                         TargetPlanes<float> planes) const {
    Result<Done> loaded = load(i, planes.image);
    const std::size_t pixels = planes.image.plane_size();
    for (std::size_t k = 0; k < pixels; ++k) {
      const bool shown = k % 48 > 8;
      for (std::size_t c = 0; c < 3 && !shown; ++c) planes.image.data[c * pixels + k] = background[c];
      planes.alpha[k] = shown ? 1.0f : 0.0f;
      planes.weight[k] = k % 7 == 0 ? 0.0f : 1.0f;
    }
    return loaded;
  }
};

TrainSettings coarse_run(std::vector<CoarseLevel> levels) {
  TrainSettings settings = compmark::testing::growing_run(120);
  settings.coarse_to_fine.levels = std::move(levels);
  return settings;
}

/// Bits of the parameters after a run.
template <class E = SerialExecutor>
std::vector<std::uint32_t> bits_after(const TrainSettings& settings, E executor = {}) {
  BlobViews views;
  Trainer<CoarseRecipe, E> trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(300, 1)).ok());
  REQUIRE(trainer.run(views).ok());
  std::vector<std::uint32_t> bits;
  for (const float value : trainer.model().arena.all_values()) bits.push_back(std::bit_cast<std::uint32_t>(value));
  return bits;
}

/// A cloud of opaque and transparent Gaussians, of `smallest` to four times as many pixels at full size.
GaussianBatch<double> coarse_cloud(double smallest, double pixels_a_unit) {
  GaussianBatch<double> batch;
  batch.resize(60);
  batch.set_zero();
  const auto g = batch.columns();
  const Random random(3, 0, random_stage("coarse cloud"));
  for (std::size_t i = 0; i < g.count; ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      g.mean[a][i] = a == 2 ? 4 + 0.2 * random.uniform(11 * i) : 1.2 * random.uniform(11 * i + 1 + a) - 0.6;
      g.scale[a][i] = smallest / pixels_a_unit * std::exp(random.uniform(11 * i + 4 + a) * std::log(4.0));
      g.color[a][i] = random.uniform(11 * i + 7 + a);
    }
    g.rotation[0][i] = 1;
    g.opacity[i] = 0.2 + 0.4 * random.uniform(11 * i + 10);
  }
  return batch;
}

struct CoarsePicture {
  int width = 0, height = 0;
  std::vector<double> values;
  [[nodiscard]] ImageView<double> view() { return {values.data(), 3, height, width}; }
};
CoarsePicture render_cloud(GaussianBatch<double>& batch, const Camera<double>& camera, double blur) {
  CoarsePicture picture{camera.width, camera.height, {}};
  picture.values.resize(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  using Raster = ReferenceRasterizer<double>;
  Raster::Settings settings;
  settings.blur_variance = blur;
  Raster::Context context;
  SerialExecutor executor;
  static_cast<void>(Raster{settings}.forward(std::as_const(batch).columns(), camera, {0.1, 0.2, 0.3}, picture.view(),
                                             context, executor));
  return picture;
}
/// The blur of a coarse projection, coarse pixels^2, that shows Gaussians of 0.3 fine pixels^2 after the box filter: a
/// box of k pixels adds (k^2 - 1) / 12 fine pixels^2 to the variance of what it averages.
double box_blur(int factor) {
  const double squared = factor * factor;
  return (0.3 + (squared - 1) / 12) / squared;
}
double picture_rms(const CoarsePicture& a, const CoarsePicture& b) {
  REQUIRE(a.values.size() == b.values.size());
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) sum += (a.values[i] - b.values[i]) * (a.values[i] - b.values[i]);
  return std::sqrt(sum / static_cast<double>(a.values.size()));
}

}  // namespace

TEST_CASE("training/coarse_to_fine: a coarse render is the box-filtered fine one") {
  constexpr double focal = 300;
  Camera<double> camera;
  camera.width = 147;  // of which a factor of 4 leaves three columns over
  camera.height = 122;
  camera.fx = focal;
  camera.fy = 1.1 * focal;
  camera.cx = 70.3;
  camera.cy = 63.9;
  for (const int factor : {2, 3, 4}) {
    CAPTURE(factor);
    Camera<double> coarse = camera;
    make_coarse(coarse, factor);
    CHECK(coarse.width == camera.width / factor);
    CHECK(coarse.fx == doctest::Approx(camera.fx / factor).epsilon(1e-14));
    // Gaussians much wider than a coarse pixel, where the box's own shape does not count.
    GaussianBatch<double> batch = coarse_cloud(3.0 * factor, focal / 4);
    CoarsePicture fine = render_cloud(batch, camera, 0.3);
    const ImageView<double> filtered = make_coarse(TargetPlanes<double>{fine.view()}, factor);
    CoarsePicture wanted{filtered.width, filtered.height, {}};
    wanted.values.assign(filtered.data, filtered.data + filtered.size());
    const double right = picture_rms(wanted, render_cloud(batch, coarse, box_blur(factor)));
    const auto wrong = [&](auto&& change, double blur) {
      Camera<double> other = coarse;
      change(other);
      return picture_rms(wanted, render_cloud(batch, other, blur));
    };
    const double kept = picture_rms(wanted, render_cloud(batch, coarse, 0.3));
    MESSAGE("factor ", factor, ": ", right, ", with the blur that training keeps ", kept);
    CHECK(right < 1e-3);  // measured 3.8e-4 to 4.5e-4
    CHECK(kept < 2e-3);   // measured 7.4e-4 to 9.4e-4
    // Centres of pixels at whole numbers, as other programs have them: half a fine pixel less half a coarse one.
    CHECK(wrong([&](Camera<double>& c) { c.cx -= 0.5 - 0.5 / factor; }, box_blur(factor)) > 5 * right);
    // The rounded size as if nothing were left over.
    if (camera.width % factor != 0)
      CHECK(wrong([&](Camera<double>& c) { c = camera.resized(c.width, c.height); }, box_blur(factor)) > 2 * right);
  }
}

TEST_CASE("training/coarse_to_fine: levels end where they say, and none is full size from the start") {
  const CoarseToFine none;
  CHECK(none.largest() == 1);
  CHECK(none.last_iteration(100) == 0);
  CHECK(none.factor(1, 100) == 1);
  const CoarseToFine two{{{4, 0.2}, {2, 0.6}}};
  CHECK(two.largest() == 4);
  CHECK(two.last_iteration(100) == 60);
  for (const auto& expected : {std::pair{1, 4}, {20, 4}, {21, 2}, {60, 2}, {61, 1}, {100, 1}}) {
    CAPTURE(expected.first);
    CHECK(two.factor(expected.first, 100) == expected.second);
  }
}

TEST_CASE("training/coarse_to_fine: what is no level is refused with what would be one") {
  CHECK(*coarse_to_fine_of("") == CoarseToFine{});
  CHECK(*coarse_to_fine_of("2:0.6") == CoarseToFine{{{2, 0.6}}});
  CHECK(*coarse_to_fine_of("4:0.2,2:0.6") == CoarseToFine{{{4, 0.2}, {2, 0.6}}});
  for (const auto& wrong : {std::pair{"2", "\"2\" is no level"},
                            {"2:", "\"2:\""},
                            {":0.5", "\":0.5\""},
                            {"2:0.5x", "\"2:0.5x\""},
                            {"2:0.5,", "\"\" is no level"},
                            {"two:0.5", "\"two:0.5\""},
                            {"2.5:0.5", "\"2.5:0.5\""},
                            {"1:0.5", "by 1"},
                            {"0:0.5", "by 0"},
                            {"-2:0.5", "by -2"},
                            {"17:0.5", "by 17"},
                            {"2:0", "at 0.0"},
                            {"2:1", "at 1.0"},
                            {"2:-1", "at -1.0"},
                            {"2:nan", "at nan"},
                            {"2:0.2,4:0.6", "factor of 2"},
                            {"4:0.6,2:0.2", "factor of 4"},
                            {"2:0.2,2:0.6", "factor of 2"}}) {
    CAPTURE(wrong.first);
    const Result<CoarseToFine> refused = coarse_to_fine_of(wrong.first);
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().field == "coarse_to_fine");
    CHECK(refused.error().problem.find(wrong.second) != std::string::npos);
    CHECK_FALSE(refused.error().remedy.empty());
  }
}

TEST_CASE("training/coarse_to_fine: a run learns from coarse images, then from whole ones, at any number of threads") {
  const TrainSettings settings = coarse_run({{2, 0.5}});
  BlobViews views;
  SerialExecutor executor;
  CoarseTrainer trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(300, 1)).ok());
  double first = 0, last = 0;
  while (!trainer.finished()) {
    const Result<IterationReport> report = trainer.step(views);
    REQUIRE(report.ok());
    const bool coarse = report->iteration <= 60;
    CHECK(trainer.image().width == (coarse ? 24 : 48));
    CHECK(trainer.target().height == (coarse ? 20 : 40));
    if (report->iteration <= 10) first += report->loss.total;
    if (report->iteration > 110) last += report->loss.total;
  }
  CHECK(last < 0.5 * first);
  const std::vector<std::uint32_t> reference = bits_after(settings);
  CHECK(reference == bits_after(settings));
  CHECK(reference == bits_after(settings, ThreadExecutor(2)));
  CHECK(reference != bits_after(coarse_run({})));
}

TEST_CASE("training/coarse_to_fine: masks, coverage, exposures and a lens are coarse with the photographs") {
  CoarseEffectViews views;
  SerialExecutor executor;
  Trainer<CoarseEffects, SerialExecutor> trainer(coarse_run({{2, 0.5}}), views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(300, 1)).ok());
  double first = 0, last = 0;
  while (!trainer.finished()) {
    const Result<IterationReport> report = trainer.step(views);
    REQUIRE(report.ok());
    CHECK(report->skipped_blocks == 0);
    CHECK(trainer.weight().size() == trainer.image().plane_size());
    CHECK(trainer.image().width == (report->iteration <= 60 ? 24 : 48));
    if (report->iteration <= 10) first += report->loss.total;
    if (report->iteration > 110) last += report->loss.total;
  }
  MESSAGE("mean loss ", first / 10, " -> ", last / 10);
  CHECK(last < 0.7 * first);
}

TEST_CASE("training/coarse_to_fine: a run that is resumed among coarse images, or after them, ends in the same bits") {
  const TrainSettings settings = coarse_run({{2, 0.5}});
  const std::vector<std::uint32_t> reference = bits_after(settings);
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark-coarse-test.safetensors";
  ModelInfo info;
  info.recipe = "small";
  for (const std::int64_t stop : {29, 60, 61}) {
    CAPTURE(stop);
    BlobViews views;
    SerialExecutor executor;
    CoarseTrainer first(settings, views.size(), 3.3, executor), second(settings, views.size(), 3.3, executor);
    REQUIRE(first.initialise(cloud(300, 1)).ok());
    while (first.state().iteration < stop) REQUIRE(first.step(views).ok());
    REQUIRE(write_checkpoint(path, first.state(), settings, info, 0).ok());
    // As another run it is not taken up.
    const auto refused = read_checkpoint<CoarseTrainer>(path, coarse_run({}), info);
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().line().find("coarse_to_fine") != std::string::npos);
    auto loaded = read_checkpoint<CoarseTrainer>(path, settings, info);
    REQUIRE(loaded.ok());
    second.restore(std::move(loaded->state));
    REQUIRE(second.run(views).ok());
    std::vector<std::uint32_t> bits;
    for (const float value : second.model().arena.all_values()) bits.push_back(std::bit_cast<std::uint32_t>(value));
    CHECK(bits == reference);
  }
  std::filesystem::remove(path);
}

TEST_CASE(
    "training/coarse_to_fine: photographs too small for the factor, and a message in coarse images, are refused") {
  BlobViews views;  // 48 x 40
  SerialExecutor executor;
  CoarseTrainer small(coarse_run({{3, 0.5}}), views.size(), 3.3, executor);
  REQUIRE(small.initialise(cloud(300, 1)).ok());
  const Result<IterationReport> step = small.step(views);
  REQUIRE_FALSE(step.ok());
  CHECK(step.error().line().find("48 x 40 pixels one of 16 x 13") != std::string::npos);
  CHECK(small.state().iteration == 0);

  CoarseTrainer none(coarse_run({{1, 0.5}}), views.size(), 3.3, executor);
  const Result<Done> begun = none.initialise(cloud(300, 1));
  REQUIRE_FALSE(begun.ok());
  CHECK(begun.error().field == "coarse_to_fine");

  using MarkedRecipe = recipes::Marked<CoarseRecipe, LatticeDecoder<float>>;
  TrainSettings mark = coarse_run({{2, 0.5}});
  mark.mark.message.after = 15000;
  CHECK(check_coarse_to_fine<MarkedRecipe>(mark).ok());
  mark.coarse_to_fine.levels[0].until = 0.55;
  CHECK(check_coarse_to_fine<CoarseRecipe>(mark).ok());
  const Result<Done> read = check_coarse_to_fine<MarkedRecipe>(mark);
  REQUIRE_FALSE(read.ok());
  CHECK(read.error().problem.find("until iteration 66") != std::string::npos);
  CHECK(read.error().problem.find("after iteration 60") != std::string::npos);
}
