// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The Quantizer that a recipe names is the one that its distortion layer asks for steps and rounds by.
#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/marked.hpp"
#include "compmark/splat/quantizer/int8_quantizer.hpp"
#include "compmark/splat/quantizer/uniform_quantizer.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;

/// Steps of powers of two, the largest that the adaptive step holds; counts how often it is asked.
struct Octaves : AdaptiveQuantizer<float> {
  static std::atomic<std::size_t>& steps() {
    static std::atomic<std::size_t> count{0};
    return count;
  }
  static std::atomic<std::size_t>& roundings() {
    static std::atomic<std::size_t> count{0};
    return count;
  }
  static float step(float r, float q0, float least) {
    ++steps();
    return std::max(std::exp2(std::floor(std::log2(adaptive_step(r, q0, least)))), least);
  }
  static float error(float x, float q) {
    ++roundings();
    return AdaptiveQuantizer<float>::error(x, q);
  }
};

using Adaptive = recipes::MarkedForCompression<testing::SmallRecipe, LatticeDecoder<float>>;
struct WithOctaves : Adaptive {
  using Quantizer = Octaves;
};
struct WithUniform : Adaptive {
  using Quantizer = UniformQuantizer<float>;
};
struct WithInt8 : Adaptive {
  using Quantizer = Int8Quantizer<float>;
};

template <class R>
std::vector<float> trained(double& mean_step) {
  TrainSettings settings;
  settings.iterations = 40;
  settings.voxel_size = 0.05;
  settings.mark.distortion.noise_after = settings.mark.distortion.adaptive_after = 0;
  settings.mark.distortion.hard_fraction = 0.5;
  settings.mark.distortion.feature_noise = 0.3;
  ThreadExecutor executor(2);
  Trainer<R, ThreadExecutor> trainer(settings, 6, 1.0, executor);
  REQUIRE(trainer.initialise(testing::cloud(300, 7)).ok());
  testing::BlobViews views;
  REQUIRE(trainer.run(views).ok());
  mean_step = trainer.context().template of<DistortionStage>().report.mean_step;
  const MatrixView<const float> feature = trainer.model().columns().feature;
  return {feature.data, feature.data + feature.size()};
}

}  // namespace

TEST_CASE("training/own_quantizer: training asks the quantizer of the recipe, and another one learns another model") {
  static_assert(std::is_same_v<RecipeDistortion<WithOctaves>, Adaptive::DistortionLayer::WithQuantizer<Octaves>>);
  double adaptive_step = 0, octave_step = 0, uniform_step = 0, int8_step = 0;
  const std::vector<float> adaptive = trained<Adaptive>(adaptive_step);
  CHECK(Octaves::steps() == 0);  // the control: nobody else asks it
  const std::vector<float> octaves = trained<WithOctaves>(octave_step);
  CHECK(Octaves::steps() > 1000);
  CHECK(Octaves::roundings() > 1000);
  const std::vector<float> uniform = trained<WithUniform>(uniform_step);
  const std::vector<float> int8 = trained<WithInt8>(int8_step);
  CHECK(octaves != adaptive);
  CHECK((int8 != adaptive && int8 != uniform));
  CHECK(int8_step < 0.1 * uniform_step);  // a 255th of the features' range, whatever the run's base step is
  CHECK(uniform != adaptive);
  CHECK(uniform_step == doctest::Approx(0.3));  // whatever the network says
  CHECK(octave_step < adaptive_step);
}
