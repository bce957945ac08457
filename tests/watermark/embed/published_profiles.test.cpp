// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the profiles "official" and "paper" claim of the published program and of the paper's text, in trainings that they begin.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "support/small_scene.hpp"

namespace published_profiles {

using namespace compmark;
using compmark::testing::BlobViews;

/// Two bits: the means of red and of green, less a third.
struct RedAndGreen {
  using Scalar = float;
  struct Context {};
  static constexpr int bits() { return 2; }
  static constexpr int minimum_size() { return 1; }
  template <Executor E>
  void forward(ImageView<const float> image, std::span<float> logits, Context&, E&) const {
    for (int c = 0; c < 2; ++c) {
      double sum = 0;
      for (std::size_t i = 0; i < image.plane_size(); ++i) sum += static_cast<double>(image.plane(c)[i]);
      logits[static_cast<std::size_t>(c)] = static_cast<float>(sum / static_cast<double>(image.plane_size()) - 1.0 / 3);
    }
  }
  template <Executor E>
  void backward(std::span<const float> d_logits, ImageView<float> d_image, Context&, E&) const {
    const float share = 1 / static_cast<float>(d_image.plane_size());
    for (int c = 0; c < 2; ++c) {
      for (std::size_t i = 0; i < d_image.plane_size(); ++i)
        d_image.plane(c)[i] += share * d_logits[static_cast<std::size_t>(c)];
    }
  }
};
static_assert(MessageDecoder<RedAndGreen>);

using Official = recipes::CompMarkGs<recipes::CompMarkBase, RedAndGreen>;
using Paper = recipes::CompMarkGsPaper<RedAndGreen>;
const std::vector<std::uint8_t> both{1, 0};

TrainSettings settings_of(const char* profile, std::int64_t iterations) {
  TrainSettings settings = *profile_settings(profile);
  settings.iterations = iterations;
  settings.voxel_size = 0.05;
  return settings;
}

/// Shows `use` the trainer after its last iteration.
template <class R, class Use>
void trained(const TrainSettings& settings, const Use& use) {
  ThreadExecutor executor(2);
  BlobViews views;
  Trainer<R, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
  set_watermark(trainer, RedAndGreen{}, both);
  REQUIRE(trainer.initialise(compmark::testing::cloud(300, 7)));
  REQUIRE(trainer.run(views));
  use(trainer);
}

/// The steps after 500 adaptive iterations.
template <class R>
StepSummary steps(const char* profile, bool held) {
  TrainSettings settings = settings_of(profile, 750);
  REQUIRE(settings.mark.distortion.adaptive_after == 10000);  // the last two thirds
  settings.mark.frequency.side = 0;                           // no step depends on it, and 1024 takes a minute
  if (!held) settings.mark.distortion.rate_weight = 0;
  StepSummary summary;
  trained<R>(settings, [&](auto& trainer) {
    const auto found =
        trainer.template stage<DistortionStage>().step_summary(trainer.context().template of<DistortionStage>());
    REQUIRE(found.has_value());
    summary = *found;
    const double absolute = trainer.context().template of<DistortionStage>().report.mean_step;
    CHECK(summary.mean == doctest::Approx(absolute / settings.mark.distortion.feature_noise).epsilon(1e-6));
  });
  return summary;
}

/// The frequency loss of a training between an image and the same a tenth brighter, as a share of that with noise.
template <class R>
double sees_the_mean(const TrainSettings& settings) {
  const auto loss = frequency_loss<R>(settings.mark);
  constexpr int side = 48;
  std::vector<float> image(3 * side * side), brighter(image), noisy(image);
  const Random random(4, 0, random_stage("test image"));
  for (std::size_t i = 0; i < image.size(); ++i) {
    image[i] = static_cast<float>(0.4 + 0.1 * random.centered(i));
    brighter[i] = image[i] + 0.3F;
    noisy[i] = static_cast<float>(0.4 + 0.1 * random.centered(image.size() + i));
  }
  SerialExecutor serial;
  typename R::FrequencyLoss::Context context;
  const auto view = [](const std::vector<float>& x) { return ImageView<const float>{x.data(), 3, side, side}; };
  const double of_mean = loss.forward(view(brighter), view(image), context, serial).loss;
  return of_mean / loss.forward(view(noisy), view(image), context, serial).loss;
}

TEST_CASE(
    "embed/published_profiles: the step of the distortion layer stays; in the published form it falls to nothing "
    "(QD2)") {
  const auto check = [](const StepSummary& held, const StepSummary& published) {
    MESSAGE("mean and median, in Q0: held ", held.mean, ", ", held.median, "; published ", published.mean, ", ",
            published.median);
    CHECK(held.mean >= 0.25);
    CHECK(held.median >= 0.25);
    CHECK(published.mean < 0.05);  // negative control
    CHECK(published.median < 0.02);
  };
  check(steps<Official>("official", true), steps<Official>("official", false));
  check(steps<Paper>("paper", true), steps<Paper>("paper", false));
}

TEST_CASE("embed/published_profiles: the message loss is a mean of ten times the logits, or a sum of plain ones") {
  const std::array<float, 2> logits{0.3F, 0.2F};
  const auto loss_of = [&](const char* profile) {
    MessageStage<RedAndGreen> stage;
    stage.set({}, both, profile_settings(profile)->mark);
    return stage.message_loss.forward(logits, both).loss;
  };
  const auto entropy = [&](double scale) {
    return std::log1p(std::exp(-scale * 0.3)) + std::log1p(std::exp(scale * 0.2));
  };
  CHECK(loss_of("official") == doctest::Approx(entropy(10) / 2).epsilon(1e-6));
  CHECK(loss_of("paper") == doctest::Approx(entropy(1)).epsilon(1e-6));
  // In the program it begins after two thirds of the run, in the paper with it.
  CHECK(MarkPhases(profile_settings("official")->mark, 30000).weights(20000).message == 0);
  CHECK(MarkPhases(profile_settings("paper")->mark, 30000).weights(1).message > 0);
  // Noise of scaling and offsets is the program's; the text has none.
  CHECK(MarkPhases(profile_settings("official")->mark, 30000).distortion(1, 0).active());
  CHECK_FALSE(MarkPhases(profile_settings("paper")->mark, 30000).distortion(1, 0).active());
  CHECK(MarkPhases(profile_settings("paper")->mark, 30000).distortion(10001, 0).adaptive);
}

TEST_CASE(
    "embed/published_profiles: the frequency loss is that of 1024 x 1024 with a ring, or of the image with a high "
    "pass") {
  const auto map_side = [](auto recipe, const char* profile) {
    int height = 0;
    trained<decltype(recipe)>(settings_of(profile, 4), [&](auto& trainer) {
      height = trainer.context().template of<FrequencyStage>().error_map().height;
    });
    return height;
  };
  CHECK(map_side(Official{}, "official") == 1024);
  CHECK(map_side(Paper{}, "paper") == BlobViews{}.height);
  CHECK(sees_the_mean<Official>(settings_of("official", 4)) > 0.01);
  CHECK(sees_the_mean<Paper>(settings_of("paper", 4)) < 1e-3);
}

TEST_CASE("embed/published_profiles: growing looks at the released program's pixel, or at the one that a mean is on") {
  std::vector<float> error(8 * 8, 0.0F);
  error[1 * 8 + 3] = 0.2F;  // row 1, column 3, in the band of both
  const auto selected = [&](auto recipe, const char* profile, float u, float v) {
    auto band = density_control<decltype(recipe)>(settings_of(profile, 100), true).settings().band;
    band.lowest = 0.1;  // the paper's own would take the others too
    const FrequencySelector<float> selector(band);
    FrequencySelector<float>::Context context;
    SerialExecutor serial;
    const std::uint8_t visible[1] = {1};
    const auto mean = [&](std::size_t) { return std::array<float, 2>{u, v}; };
    return selector.select({error.data(), 1, 8, 8}, 8, 8, visible, mean, context, serial).selected == 1;
  };
  CHECK(selected(Paper{}, "paper", 3.5F, 1.5F));
  CHECK_FALSE(selected(Paper{}, "paper", 1.5F, 3.5F));
  CHECK(selected(Official{}, "official", 1.5F, 3.5F));  // row = x, column = y
  CHECK_FALSE(selected(Official{}, "official", 3.5F, 1.5F));
}

TEST_CASE("embed/published_profiles: the image whose hues count is a setting; both profiles have the render") {
  const auto loss_of = [](MarkNumbers mark) {
    std::vector<float> grey(3 * 4, 0.5F), red(3 * 4, 0.1F);
    for (std::size_t i = 0; i < 4; ++i) red[i] = 0.9F;
    SerialExecutor serial;
    Official::HsvLoss::Context context;
    return hsv_loss<Official>(mark).forward({grey.data(), 3, 2, 2}, {red.data(), 3, 2, 2}, context, serial).loss;
  };
  for (const char* profile : {"official", "paper"}) {
    CAPTURE(profile);
    MarkNumbers mark = profile_settings(profile)->mark;
    CHECK(loss_of(mark) == 0);  // a grey render is free
    mark.hsv.source = HueSource::target;
    CHECK(loss_of(mark) > 0.01);
  }
}

}  // namespace published_profiles
