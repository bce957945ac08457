// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The Quantizer that a recipe names is the one that its codec trains with and writes: with UniformQuantizer every value
// of a file is a multiple of its base step.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/splat/quantizer/uniform_quantizer.hpp>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "support/coded_training.hpp"

namespace coded_quantizer_test {
namespace {

using namespace compmark;

template <class Adaptive>
struct WithUniform : Adaptive {
  using Quantizer = UniformQuantizer<float>;
};
template <class Adaptive>
struct WithAdaptive : Adaptive {
  using Quantizer = AdaptiveQuantizer<float>;
};

constexpr double feature_step = 0.02, scaling_step = 0.01, offset_step = 0.05;

template <class R>
testing::Trained<R> trained() {
  TrainSettings settings = testing::short_settings(90);
  settings.rate.feature_step = feature_step;
  settings.rate.offset_step = offset_step;
  testing::Trained<R> result;
  testing::train_until<R>(settings, 2, 90, 0, [&](const auto& trainer) {
    result = {trainer.model(), trainer.context().template of<RateStage>().report};
  });
  return result;
}

/// How far the values of a file are from multiples of their base steps, at most.
template <class R>
double off_grid(const testing::Trained<R>& trained) {
  ModelInfo info;
  info.base_step = {feature_step, scaling_step, offset_step};
  const Result<CodecModel> coded = coded_model(trained.model, info);
  REQUIRE(coded.ok());
  ThreadExecutor executor(2);
  const Result<CodecEncoded> file = encode_cmk(*coded, CodecEncodeSettings{}, executor);
  REQUIRE(file.ok());
  const Result<CodecDecoded> decoded = decode_cmk(file->bytes, "a.cmk", CodecDecodeSettings{}, executor);
  REQUIRE(decoded.ok());
  double worst = 0;
  const auto look = [&](const std::vector<float>& values, double step) {
    REQUIRE(std::any_of(values.begin(), values.end(), [](float value) { return value != 0; }));
    for (const float value : values) {
      const double symbol = static_cast<double>(value) / step;
      worst = std::max(worst, std::abs(symbol - std::nearbyint(symbol)));
    }
  };
  look(decoded->model.feature, feature_step);
  look(decoded->model.scale, scaling_step);
  look(decoded->model.offset, offset_step);
  return worst;
}

}  // namespace

TEST_CASE_TEMPLATE("model/coded_quantizer: with uniform steps a codec trains and writes base steps alone", R,
                   testing::SmallGridHac, testing::SmallContextGs) {
  const auto uniform = trained<WithUniform<R>>();
  CHECK(uniform.rate.step_feature == doctest::Approx(feature_step).epsilon(1e-6));
  CHECK(uniform.rate.step_scaling == doctest::Approx(scaling_step).epsilon(1e-6));
  CHECK(uniform.rate.step_offset == doctest::Approx(offset_step).epsilon(1e-6));
  CHECK(off_grid(uniform) < 1e-3);

  const auto adaptive = trained<R>();  // the control
  CHECK(adaptive.rate.step_feature != doctest::Approx(feature_step).epsilon(1e-6));
  CHECK(off_grid(adaptive) > 0.01);
  static_assert(std::is_same_v<RecipeEntropyModel<WithAdaptive<R>>, typename R::EntropyModel>);
}

}  // namespace coded_quantizer_test
