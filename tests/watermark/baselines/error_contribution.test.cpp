// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/error_contribution.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <compmark/core/executor.hpp>
#include <compmark/splat/export/contributions.hpp>
#include <cstddef>
#include <set>
#include <vector>

#include "support/directional.hpp"
#include "support/full_rasterizer.hpp"

using namespace compmark;

namespace {

/// One camera shows more than there is memory for: that of another width.
constexpr bool of_25_columns(const Camera<double>& camera) { return camera.width == 25; }
struct ContributionFull : testing::SmoothRecipe {
  using Rasterizer = testing::FullRasterizer<testing::SmoothRecipe::Rasterizer, of_25_columns>;
};

}  // namespace

TEST_CASE("baselines/error_contribution: with one error everywhere it is that of every Gaussian to the picture") {
  using R = testing::SmoothRecipe;
  Model<R> model = testing::random_model<R>(8);
  model.arena.values(model.anchors.position)(3, 1) = 1e4;  // out of sight
  const Camera<double> camera = testing::ring_camera(1, 5, 23, 19);
  SerialExecutor serial;
  const Pipeline<R> pipeline;
  Pipeline<R>::Context context;
  static_cast<void>(pipeline.forward(model, camera, 0, context, serial));
  std::vector<double> photograph;
  for (const double value : ImageView<const double>(context.image).flat()) photograph.push_back(value + 0.5);
  ErrorContribution<R> contribution(model);
  REQUIRE(contribution.add_view(camera, 0, {photograph.data(), 3, 19, 23}, serial).ok());

  std::vector<double> expected(8, 0.0);
  ContributionMeter<R> meter;
  const auto measured = meter.measure(model, camera, 0, serial);
  REQUIRE(measured.ok());
  for (const auto& slot : measured->slots) {
    double& most = expected[slot.first / 3];
    most = std::max(most, 0.5 * static_cast<double>(slot.second) / (3 * 19 * 23));
  }
  std::size_t seen = 0;
  for (std::size_t row = 0; row < 8; ++row) {
    CAPTURE(row);
    CHECK(contribution.largest()[row] == doctest::Approx(expected[row]).epsilon(1e-6));  // the meter is of floats
    if (expected[row] > 0) ++seen;
  }
  CHECK(seen >= 5);
  CHECK(contribution.largest()[3] == 0);
  std::set<std::size_t> anchors;
  contribution.for_gaussians([&](std::size_t anchor, const std::array<double, 3>&) { anchors.insert(anchor); });
  CHECK(anchors.count(3) == 0);
  CHECK(anchors.size() >= seen);

  // Where a render is right nothing is carried, and the largest of two views counts.
  const std::vector<double> kept(contribution.largest().begin(), contribution.largest().end());
  REQUIRE(contribution.add_view(camera, 0, context.image, serial).ok());
  CHECK(std::equal(kept.begin(), kept.end(), contribution.largest().begin()));
  for (double& value : photograph) value += 0.5;
  REQUIRE(contribution.add_view(camera, 0, {photograph.data(), 3, 19, 23}, serial).ok());
  for (std::size_t row = 0; row < 8; ++row)
    CHECK(contribution.largest()[row] == doctest::Approx(2 * kept[row]).epsilon(1e-9));
}

TEST_CASE("baselines/error_contribution: a view that could not be drawn is an error, and contributes nothing") {
  const Model<ContributionFull> model = testing::random_model<ContributionFull>(8);
  const Camera<double> drawn = testing::ring_camera(1, 5, 23, 19), full = testing::ring_camera(1, 5, 25, 19);
  SerialExecutor serial;
  const std::vector<double> photograph(3 * 25 * 19, 0.5);
  ErrorContribution<ContributionFull> contribution(model);
  const Result<Done> refused = contribution.add_view(full, 0, {photograph.data(), 3, 19, 25}, serial);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "raster.pair_budget");
  for (const double largest : contribution.largest()) CHECK(largest == 0);
  REQUIRE(contribution.add_view(drawn, 0, {photograph.data(), 3, 19, 23}, serial).ok());
  CHECK(*std::max_element(contribution.largest().begin(), contribution.largest().end()) > 0);
}
