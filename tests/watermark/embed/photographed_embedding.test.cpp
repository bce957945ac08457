// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A mark that is held to photographs in a share of its iterations (PosthocSettings::photograph_share).
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/splat/effect/pixel_weights.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/embed/base_model.hpp>
#include <compmark/watermark/embed/posthoc_embedding.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "support/colour_decoder.hpp"
#include "support/short_embedding.hpp"
#include "support/small_scene.hpp"

namespace photographed_embedding_test {
namespace {

using namespace compmark;
using Unmarked = compmark::testing::SmallRecipe;
using Colours = LatticeDecoder<float>;
using PhotographedRecipe = recipes::Marked<Unmarked, Colours>;
using Embedding = PosthocEmbedding<PhotographedRecipe, ThreadExecutor>;

struct MaskedUnmarked : Unmarked {
  using PixelWeights = MaskedPixels<float>;
};

/// The blob's photographs, of which the left half has a mask; and what is there is white.
struct HalfMaskedViews : compmark::testing::BlobViews {
  bool masked = true;
  Result<Done> load_planes(std::size_t i, std::array<float, 3>, TargetPlanes<float> planes) const {
    const Result<Done> loaded = load(i, planes.image);
    for (int y = 0; y < planes.image.height; ++y) {
      for (int x = 0; x < planes.image.width; ++x) {
        const bool left = 2 * x < planes.image.width;
        if (left) {
          for (int c = 0; c < 3; ++c) planes.image(c, y, x) = 1;
        }
        if (planes.weight != nullptr) planes.weight[y * planes.image.width + x] = left && masked ? 0.0f : 1.0f;
      }
    }
    return loaded;
  }
};

/// Mean square difference of the renders to the photographs, over the right half or all.
template <class R, class Views>
double error_to_photographs(const Model<R>& model, const Views& views, bool right_half, ThreadExecutor& executor) {
  Pipeline<R> pipeline;
  typename Pipeline<R>::Context context;
  double sum = 0, count = 0;
  std::vector<float> photograph(3 * 48 * 40);
  const ImageView<float> target{photograph.data(), 3, 40, 48};
  for (std::size_t i = 0; i < views.size(); ++i) {
    REQUIRE_FALSE(pipeline.forward(model, views.camera(i), unseen_view, context, executor).raster.error);
    REQUIRE(views.load(i, target));
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < 40; ++y) {
        for (int x = right_half ? 24 : 0; x < 48; ++x) {
          const double difference = static_cast<double>(context.image(c, y, x)) - static_cast<double>(target(c, y, x));
          sum += difference * difference;
          count += 1;
        }
      }
    }
  }
  return sum / count;
}

TrainSettings looking(double share, double message, std::int64_t iterations = 24) {
  TrainSettings settings = compmark::testing::short_embedding(iterations);
  settings.mark.posthoc.photograph_share = share;
  settings.mark.message.lambda = message;
  return settings;
}

template <class R, class Views>
Model<typename R::Base> marked(const Model<typename R::Base>& base, const TrainSettings& settings, Views& views,
                               ThreadExecutor& executor) {
  PosthocEmbedding<R, ThreadExecutor> embedding(settings, executor);
  set_watermark(embedding, compmark::testing::colours(), compmark::testing::eight_bits);
  embedding.start_from(with_room_for_stages<R>(base, 1));
  REQUIRE(embedding.run(views));
  return baked_model(embedding.model());
}

TEST_CASE("embed/photographed_embedding: a mark that looks at photographs costs less of them") {
  const compmark::testing::BlobViews views;
  ThreadExecutor executor(2);
  const auto base = compmark::testing::briefly_trained<Unmarked>(views, executor);
  REQUIRE(base.ok());
  const double before = error_to_photographs(*base, views, false, executor);
  // Nearly no message: what is learned is the photographs.
  const auto error = [&](double share, double message) {
    return error_to_photographs(marked<PhotographedRecipe>(*base, looking(share, message, 60), views, executor), views,
                                false, executor);
  };
  CHECK(error(1, 1e-6) < 0.8 * before);
  // Control: without photographs there is nothing to learn from but the unmarked renders.
  CHECK(error(0, 1e-6) == doctest::Approx(before).epsilon(1e-3));
  const double unseen = error(0, 1), seen = error(0.5, 1);
  MESSAGE("squared error to the photographs: ", before, " unmarked, ", unseen, " marked, ", seen,
          " where half of the iterations look at them");
  CHECK(unseen > before);
  CHECK(seen < unseen);
}

TEST_CASE("embed/photographed_embedding: which iterations look follows from seed and iteration, after a stop too") {
  const compmark::testing::BlobViews views;
  ThreadExecutor two(2), one(1);
  const auto base = compmark::testing::briefly_trained<Unmarked>(views, two);
  REQUIRE(base.ok());
  const TrainSettings settings = looking(0.4, 1);
  const auto started = [&](ThreadExecutor& executor, const TrainSettings& wanted) {
    Embedding embedding(wanted, executor);
    set_watermark(embedding, compmark::testing::colours(), compmark::testing::eight_bits);
    embedding.start_from(with_room_for_stages<PhotographedRecipe>(*base, 1));
    return embedding;
  };
  using compmark::testing::same_values;
  Embedding first = started(two, settings), second = started(one, settings), blind = started(two, looking(0, 1));
  REQUIRE(first.run(views));
  REQUIRE(second.run(views));
  REQUIRE(blind.run(views));
  CHECK(same_values(first.model(), second.model()));
  CHECK_FALSE(same_values(first.model(), blind.model()));  // negative control

  Embedding stopped = started(two, settings);
  std::size_t looked = 0;
  std::vector<float> photograph(3 * 48 * 40);
  const ImageView<float> whole{photograph.data(), 3, 40, 48};
  for (int i = 0; i < 9; ++i) {
    const auto report = stopped.step(views);
    REQUIRE(report.ok());
    REQUIRE(views.load(report->view, whole));
    looked += std::equal(photograph.begin(), photograph.end(), stopped.target().data) ? 1 : 0;
  }
  CHECK(looked > 0);
  CHECK(looked < 9);
  const auto path = std::filesystem::temp_directory_path() / "compmark_test_photographed.ckpt";
  REQUIRE(write_checkpoint(path, stopped.state(), settings, ModelInfo{}, 0).ok());
  auto loaded = read_checkpoint<Embedding>(path, settings, ModelInfo{});
  REQUIRE(loaded.ok());
  CHECK_FALSE(read_checkpoint<Embedding>(path, looking(0.3, 1), ModelInfo{}).ok());  // another share is another run
  Embedding resumed(settings, two);
  set_watermark(resumed, compmark::testing::colours(), compmark::testing::eight_bits);
  resumed.restore(std::move(loaded->state));
  REQUIRE(resumed.run(views));
  CHECK(same_values(resumed.model(), first.model()));
  std::filesystem::remove(path);
}

TEST_CASE("embed/photographed_embedding: pixels that do not count are not learned") {
  HalfMaskedViews views, all_count;
  all_count.masked = false;
  ThreadExecutor executor(2);
  const auto base = compmark::testing::briefly_trained<MaskedUnmarked>(views, executor);
  REQUIRE(base.ok());
  using Masked = recipes::Marked<MaskedUnmarked, Colours>;
  const TrainSettings settings = looking(1, 1e-6, 40);
  const double before = error_to_photographs(*base, views, true, executor);
  const double of_counted =
      error_to_photographs(marked<Masked>(*base, settings, views, executor), views, true, executor);
  const double of_all =
      error_to_photographs(marked<Masked>(*base, settings, all_count, executor), views, true, executor);
  MESSAGE("squared error of the right half: ", before, " unmarked, ", of_counted,
          " where the white left does not count, ", of_all, " where it does");
  CHECK(of_counted < before);
  CHECK(of_counted < of_all);  // negative control: a wrong half spoils the other
}

TEST_CASE("embed/photographed_embedding: the gradient of the weighted difference is that of its mean") {
  ThreadExecutor executor(2);
  std::vector<double> image(3 * 4 * 5), target(image.size()), gradient(image.size()), weight(20);
  const Random random(3, 0, random_stage("weighted difference"));
  for (std::size_t i = 0; i < image.size(); ++i) {
    image[i] = random.uniform(i);
    target[i] = random.uniform(100 + i);
  }
  for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = i % 3 == 0 ? 0 : random.uniform(200 + i);
  Buffer<double> sums;
  const auto loss = [&](std::span<const double> counts) {
    return detail::square_distortion<double>({image.data(), 3, 4, 5}, {target.data(), 3, 4, 5}, 7.0,
                                             {gradient.data(), 3, 4, 5}, sums, executor, counts);
  };
  static_cast<void>(loss(weight));
  const std::vector<double> analytic = gradient;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double at = image[i], step = 1e-6;
    image[i] = at + step;
    const double above = loss(weight);
    image[i] = at - step;
    const double below = loss(weight);
    image[i] = at;
    CHECK(analytic[i] == doctest::Approx(7 * (above - below) / (2 * step)).epsilon(1e-6));
    if (weight[i % 20] == 0) CHECK(analytic[i] == 0);
  }
  const std::vector<double> ones(20, 1.0);
  CHECK(loss({}) == loss(ones));
}

}  // namespace
}  // namespace photographed_embedding_test
