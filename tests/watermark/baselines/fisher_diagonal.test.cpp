// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/fisher_diagonal.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/testing/gradient.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "support/directional.hpp"
#include "support/full_rasterizer.hpp"

using namespace compmark;

namespace {

using FisherHost = testing::SmallestSmoothRecipe;

/// One camera shows more than there is memory for: that of another width.
constexpr bool of_nine_columns(const Camera<double>& camera) { return camera.width == 9; }
struct FisherFull : FisherHost {
  using Rasterizer = testing::FullRasterizer<FisherHost::Rasterizer, of_nine_columns>;
};

/// The sum over all pixels and channels, one pass for each.
std::vector<double> exact_information(const Model<FisherHost>& model, const Camera<double>& camera) {
  SerialExecutor serial;
  FisherDiagonal<FisherHost> fisher(model);
  const std::size_t size = 3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  for (std::size_t pixel = 0; pixel < size; ++pixel) {
    const Result<Done> added = fisher.add_squares(
        camera, 0,
        [&](ImageView<double> slope) {
          for (std::size_t i = 0; i < slope.size(); ++i) slope.data[i] = i == pixel ? 1 : 0;
        },
        serial);
    REQUIRE(added.ok());
  }
  return {fisher.information().begin(), fisher.information().end()};
}

}  // namespace

TEST_CASE("baselines/fisher_diagonal: the squares of one anchor are those of central differences") {
  Model<FisherHost> model = testing::random_model<FisherHost>(6);
  const Camera<double> camera = testing::ring_camera(1, 5, 7, 6);
  const std::vector<double> exact = exact_information(model, camera);
  SerialExecutor serial;
  const Pipeline<FisherHost> pipeline;
  Pipeline<FisherHost>::Context context;
  const std::size_t row = 2;
  double sum = 0;
  for (const BlockHandle block : {model.anchors.feature, model.anchors.offset}) {
    const auto table = model.arena.values(block);
    for (std::size_t c = 0; c < table.columns; ++c) {
      double& x = table.row(row)[c];
      for (std::size_t pixel = 0; pixel < 3 * 7 * 6; ++pixel) {
        const double slope = testing::central_difference(
            [&] {
              static_cast<void>(pipeline.forward(model, camera, 0, context, serial));
              return context.image.data[pixel];
            },
            x);
        sum += slope * slope;
      }
    }
  }
  CHECK(sum > 1e-6);
  CHECK(exact[row] == doctest::Approx(sum).epsilon(1e-6));
}

TEST_CASE("baselines/fisher_diagonal: the mean over signs is the sum of squares, and the sum of all pixels is not") {
  const Model<FisherHost> model = testing::random_model<FisherHost>(6);
  const Camera<double> camera = testing::ring_camera(1, 5, 7, 6);
  const std::vector<double> exact = exact_information(model, camera);
  SerialExecutor serial;
  constexpr int draws = 1000;
  FisherDiagonal<FisherHost> signs(model), sums(model);
  for (std::uint64_t seed = 0; seed < draws; ++seed) REQUIRE(signs.add_view(camera, 0, seed, serial).ok());
  const Result<Done> added = sums.add_squares(
      camera, 0,
      [](ImageView<double> slope) {
        for (double& one : slope.flat()) one = 1;
      },
      serial);
  REQUIRE(added.ok());
  double worst_sum = 0;
  for (std::size_t row = 0; row < exact.size(); ++row) {
    CAPTURE(row);
    if (exact[row] == 0) continue;
    // A square of a sum of signs deviates by at most sqrt 2 of itself: 4.5 % for the mean of 1,000, and 3.5 of those.
    CHECK(signs.information()[row] / draws == doctest::Approx(exact[row]).epsilon(0.16));
    worst_sum = std::max(worst_sum, std::abs(sums.information()[row] / exact[row] - 1));
  }
  CHECK(worst_sum > 0.5);  // the control

  // Another view has other signs, and an anchor out of sight has nothing.
  Model<FisherHost> hidden = model;
  hidden.arena.values(hidden.anchors.position)(3, 1) = 1e4;
  FisherDiagonal<FisherHost> one(hidden), other(hidden);
  REQUIRE(one.add_view(camera, 0, 7, serial).ok());
  REQUIRE(other.add_view(camera, 1, 7, serial).ok());
  CHECK(one.information()[3] == 0);
  CHECK(one.information()[2] > 0);
  CHECK(one.information()[2] != other.information()[2]);
}

TEST_CASE("baselines/fisher_diagonal: a view that could not be drawn is an error, and says nothing of an anchor") {
  const Model<FisherFull> model = testing::random_model<FisherFull>(6);
  const Camera<double> drawn = testing::ring_camera(1, 5, 7, 6), full = testing::ring_camera(1, 5, 9, 6);
  SerialExecutor serial;
  FisherDiagonal<FisherFull> fisher(model);
  const Result<Done> refused = fisher.add_view(full, 0, 7, serial);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "raster.pair_budget");
  for (const double information : fisher.information()) CHECK(information == 0);
  REQUIRE(fisher.add_view(drawn, 0, 7, serial).ok());
  CHECK(*std::max_element(fisher.information().begin(), fisher.information().end()) > 0);
}
