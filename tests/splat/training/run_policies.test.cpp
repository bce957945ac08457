// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/training/run_policies.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>

#include "compmark/recipes/marked.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"

using namespace compmark;

namespace {

/// Policies that keep what they were told; each names some of the numbers, and one names none.
template <class Numbers>
struct Told {
  static constexpr bool is_absent = false;
  using Settings = Numbers;
  explicit Told(const Settings& told) : settings(told) {}
  Settings settings;
};
struct EveryGrowthNumber {
  double gradient_threshold = -1, success_threshold = -1, min_opacity = -1;
  int init_factor = -1, offsets = -1;
  std::int64_t interval = -1;
  std::size_t max_anchors = 0;
};
struct OneGrowthNumber {
  double gradient_threshold = -1, of_its_own = 7;
};
struct NoNumber {};
struct EveryNoiseNumber {
  double base_step = -1, least_step = -1, rate_weight = -1, of_its_own = 7;
};

template <class Growth, class Noise = NoNumber>
struct Recorded : recipes::Scaffold {
  using DensityControl = Told<Growth>;
  using DistortionLayer = Told<Noise>;
};

bool same(const Window& a, const Window& b) {
  for (std::int64_t t = -2; t < 40000; ++t) {
    if (a.contains(t) != b.contains(t)) return false;
  }
  return true;
}
bool same(const DensityPhases& a, const DensityPhases& b) {
  return same(a.statistics, b.statistics) && same(a.growing, b.growing) && same(a.pause, b.pause) &&
         a.interval == b.interval;
}

}  // namespace

TEST_CASE("training/run_policies: the phases of each profile are the published ones, at any length") {
  for (const std::int64_t iterations : {30000, 10000, 600}) {
    const auto phases = [&](const char* profile) {
      TrainSettings settings = *profile_settings(profile);
      settings.iterations = iterations;
      return density_phases(settings);
    };
    CAPTURE(iterations);
    CHECK(same(phases("scaffold"), DensityPhases::scaffold(iterations)));
    CHECK(same(phases("hac"), DensityPhases::hac(iterations)));
    CHECK(same(phases("official"), DensityPhases::official(iterations)));
    CHECK_FALSE(same(phases("scaffold"), DensityPhases::hac(iterations)));  // the comparison can tell
    // Inside a codec the profiles of CompMarkGS have its pause, too.
    for (const char* profile : {"official", "paper"}) {
      CAPTURE(profile);
      TrainSettings settings = for_codec(*profile_settings(profile));
      settings.iterations = iterations;
      CHECK(same(density_phases(settings).pause, DensityPhases::hac(iterations).pause));
      CHECK(same(density_phases(settings).growing, phases(profile).growing));
    }
    CHECK_FALSE(same(phases("paper").pause, DensityPhases::hac(iterations).pause));
  }
}

TEST_CASE("training/run_policies: density control is told the numbers that it names, and keeps its own") {
  TrainSettings run;
  run.gradient_threshold = 1;
  run.success_threshold = 2;
  run.min_opacity = 3;
  run.init_factor = 4;
  run.grow_interval = 5;
  run.max_anchors = 6;
  const EveryGrowthNumber all = density_control<Recorded<EveryGrowthNumber>>(run).settings;
  CHECK(all.gradient_threshold == 1);
  CHECK(all.success_threshold == 2);
  CHECK(all.min_opacity == 3);
  CHECK(all.init_factor == 4);
  CHECK(all.interval == 5);
  CHECK(all.max_anchors == 6);
  CHECK(all.offsets == recipes::Scaffold::AnchorModel::shape.offsets);

  const OneGrowthNumber one = density_control<Recorded<OneGrowthNumber>>(run).settings;
  CHECK(one.gradient_threshold == 1);
  CHECK(one.of_its_own == 7);
  (void)density_control<Recorded<NoNumber>>(run);  // compiles
}

TEST_CASE("training/run_policies: a distortion layer is told the numbers that it names") {
  MarkNumbers mark;
  mark.distortion.feature_noise = 1;
  mark.distortion.least_step = 2;
  mark.distortion.rate_weight = 3;
  const EveryNoiseNumber all = distortion_layer<Recorded<NoNumber, EveryNoiseNumber>>(mark).settings;
  CHECK(all.base_step == 1);
  CHECK(all.least_step == 2);
  CHECK(all.rate_weight == 3);
  CHECK(all.of_its_own == 7);
  (void)distortion_layer<Recorded<NoNumber>>(mark);  // compiles
}

TEST_CASE("training/run_policies: saturated colours are those that were released, or those of the paper's text") {
  using Marked = recipes::Marked<recipes::Scaffold, LatticeDecoder<float>>;
  using Hsv = Marked::HsvLoss;
  const auto same_colours = [](const Hsv::Settings& a, const Hsv::Settings& b) {
    return a.thirds == b.thirds && a.norm == b.norm && a.saturation == b.saturation && a.value == b.value;
  };
  for (const char* profile : {"scaffold", "hac", "official"}) {
    CAPTURE(profile);
    CHECK(same_colours(hsv_loss<Marked>(profile_settings(profile)->mark).settings, Hsv::Settings{}));
  }
  CHECK(same_colours(hsv_loss<Marked>(profile_settings("paper")->mark).settings, Hsv::Settings::paper()));
  CHECK_FALSE(same_colours(Hsv::Settings{}, Hsv::Settings::paper()));  // the comparison can tell
}
