// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Every number of a run is in the JSON that a checkpoint is compared by: one that is left out would let a run go on as another one. The fields are
// taken apart by structured bindings, which do not compile any more when a field is added, so that none is forgotten here.
#include <doctest/doctest.h>

#include <array>
#include <compmark/splat/training/settings_json.hpp>
#include <concepts>
#include <cstddef>
#include <optional>
#include <string>

namespace {

using namespace compmark;

/// Counts the numbers it is shown and changes one of them.
struct ChangeOne {
  std::size_t wanted;
  std::size_t seen = 0;

  template <class Number>
    requires std::integral<Number> || std::floating_point<Number>
  void operator()(Number& number) {
    if (seen++ == wanted) number = static_cast<Number>(number + 1);
  }
  void operator()(HueSource& source) {
    if (seen++ == wanted) source = HueSource::either;
  }
  void operator()(std::string& text) {
    if (seen++ == wanted) text += "x";
  }
  void operator()(LearningRate& rate) {
    auto& [initial, final] = rate;
    all(initial, final);
  }
  template <class Number, std::size_t count>
  void operator()(std::array<Number, count>& numbers) {
    for (Number& number : numbers) (*this)(number);
  }
  template <class... Fields>
  void all(Fields&... fields) {
    ((*this)(fields), ...);
  }

  void operator()(EffectNumbers& effects) {
    auto& [exposure, alpha, origin, radius] = effects;
    all(exposure, alpha, origin, radius);
  }
  void operator()(MessageSettings& message) {
    auto& [f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11] = message;
    all(f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11);
  }
  void operator()(PosthocSettings& posthoc) {
    auto& [f0, f1, f2, f3, f4, f5, f6] = posthoc;
    all(f0, f1, f2, f3, f4, f5, f6);
  }
  void operator()(HsvSettings& hsv) {
    auto& [lambda, as_written, source, after] = hsv;
    all(lambda, as_written, source, after);
  }
  void operator()(FrequencySettings& frequency) {
    auto& [f0, f1, f2, f3, f4, f5, f6, f7, f8] = frequency;
    all(f0, f1, f2, f3, f4, f5, f6, f7, f8);
  }
  void operator()(ResidualSettings& residual) {
    auto& [learning_rate, decay, after, harmonics] = residual;
    all(learning_rate, decay, after, harmonics);
  }
  void operator()(DistortionSettings& distortion) {
    auto& [f0, f1, f2, f3, f4, f5, f6, f7, f8] = distortion;
    all(f0, f1, f2, f3, f4, f5, f6, f7, f8);
  }
  void operator()(MarkNumbers& mark) {
    auto& [message, posthoc, hsv, frequency, residual, distortion, identity] = mark;
    all(message, posthoc, hsv, frequency, residual, distortion, identity);
  }
  void operator()(RateNumbers& rate) {
    auto& [f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11, f12, f13] = rate;
    all(f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11, f12, f13);
  }
  void operator()(CoarseLevel& level) {
    auto& [factor, until] = level;
    all(factor, until);
  }
  void operator()(CoarseToFine& coarse) {
    auto& [levels] = coarse;
    for (CoarseLevel& level : levels) (*this)(level);
  }
  void operator()(TrainSettings& settings) {
    auto& [f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11, f12, f13, f14, f15, f16, f17, f18, f19, f20, f21, f22, f23,
           f24, f25, f26, f27, f28, coarse, effects, mark, rate] = settings;
    all(f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11, f12, f13, f14, f15, f16, f17, f18, f19, f20, f21, f22, f23,
        f24, f25, f26, f27, f28, coarse, effects, mark, rate);
  }
};

/// Settings whose effects, mark and rate are named already: the first change of one alone would name them.
TrainSettings named() {
  TrainSettings settings;
  settings.coarse_to_fine.levels = {{4, 0.2}, {2, 0.6}};
  settings.effects.space_radius = 3;
  settings.mark.identity = "a key";
  settings.rate.sample = 0.25;
  return settings;
}

}  // namespace

TEST_CASE("training/settings_json: every number of a run tells it from another run") {
  ChangeOne count{static_cast<std::size_t>(-1)};
  TrainSettings settings = named();
  count(settings);
  CHECK(settings_json(settings) == settings_json(named()));  // nothing was changed
  CHECK(count.seen > 80);
  for (std::size_t i = 0; i < count.seen; ++i) {
    CAPTURE(i);
    TrainSettings other = named();
    ChangeOne change{i};
    change(other);
    CHECK(settings_json(other) != settings_json(named()));
  }
}

TEST_CASE("training/settings_json: what is as the profile has it is not named") {
  for (const char* profile : {"scaffold", "hac", "official", "paper"}) {
    CAPTURE(profile);
    const std::optional<TrainSettings> settings = profile_settings(profile);
    REQUIRE(settings.has_value());
    for (const char* key : {"coarse_to_fine", "effects", "mark", "rate"})
      CHECK_FALSE(settings_json(*settings).contains(key));
  }
  for (const char* key : {"coarse_to_fine", "effects", "mark", "rate"}) CHECK(settings_json(named()).contains(key));
}
