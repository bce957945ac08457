// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Points far away, handed to a trainer by who has no dataset: the run is to the bit that without them. Between core and reach they stay, and
// neither own the first loss nor the context of a compressed file.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstdint>
#include <limits>
#include <vector>

#include "support/coded_training.hpp"
#include "support/short_training.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;
using compmark::testing::SmallGridHac;
using compmark::testing::SmallRecipe;

using Points = std::vector<std::array<float, 3>>;

TrainSettings growing(std::int64_t iterations) {
  TrainSettings settings;
  settings.iterations = iterations;
  settings.grow_interval = 10;
  settings.statistics_after = 1000;
  settings.grow_after = 2000;
  settings.grow_until = 29000;
  settings.gradient_threshold = 1e-5;
  settings.voxel_size = 0.05;
  settings.init_factor = 4;
  return settings;
}

struct OutlierRun {
  std::vector<std::uint32_t> bits;
  std::size_t left_out = 0;
  double first_loss = 0, first_volume = 0;
};
template <class R = SmallRecipe>
OutlierRun train_outliers(const Points& points, std::int64_t iterations) {
  SerialExecutor executor;
  const BlobViews views;
  Trainer<R, SerialExecutor> trainer(growing(iterations), views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(points).ok());
  OutlierRun run;
  run.left_out = trainer.far_points();
  while (!trainer.finished()) {
    const Result<IterationReport> report = trainer.step(views);
    REQUIRE(report.ok());
    if (report->iteration != 1) continue;
    run.first_loss = report->loss.total;
    run.first_volume = report->loss.volume;
  }
  for (const float x : trainer.model().arena.all_values()) run.bits.push_back(std::bit_cast<std::uint32_t>(x));
  return run;
}

}  // namespace

TEST_CASE("training/outliers: points beyond the reach leave a training without a trace") {
  const Points near = cloud(200, 1);
  const OutlierRun clean = train_outliers(near, 40);
  CHECK(clean.left_out == 0);
  for (const float away : {4e3f, 1e5f, 1e30f}) {
    for (const std::size_t far : {std::size_t{1}, std::size_t{3}, std::size_t{20}}) {
      CAPTURE(away);
      CAPTURE(far);
      Points points = near;
      for (std::size_t i = 0; i < far; ++i)
        points.insert(points.begin() + static_cast<std::ptrdiff_t>(3 * i),
                      {away * static_cast<float>(1 + 0.1 * double(i)), i % 2 == 0 ? away : -away, 0});
      const OutlierRun run = train_outliers(points, 40);
      CHECK(run.left_out == far);
      CHECK(run.bits == clean.bits);
    }
  }
}

TEST_CASE("training/outliers: a lone point within the reach does not own the first loss") {
  const Points near = cloud(200, 1);
  const OutlierRun clean = train_outliers(near, 1);
  for (const float away : {100.0f, 250.0f}) {  // 30 and 76 radii of the cameras, in sight of some
    Points points = near;
    points.push_back({0, 0, away});
    const OutlierRun run = train_outliers(points, 1);
    CAPTURE(away);
    CHECK(run.left_out == 0);
    CHECK(run.bits != clean.bits);
    CHECK(run.first_loss < clean.first_loss + 10);
    // The control: with the distance of the others as its scale the mean of volumes is this.
    CHECK(0.01 * std::pow(0.5 * double(away), 3) / 600 > (away > 200 ? 10 : 1));
  }
}

TEST_CASE("training/outliers: the context of a compressed training covers the scene, not the way to one far point") {
  const auto box_width = [](const Points& points) {
    TrainSettings settings = compmark::testing::short_settings(30);
    SerialExecutor executor;
    const BlobViews views;
    Trainer<SmallGridHac, SerialExecutor> trainer(settings, views.size(), 3.3, executor);
    REQUIRE(trainer.initialise(points).ok());
    REQUIRE(trainer.run(views).ok());
    const auto box = trainer.model().arena.values(trainer.model().template blocks<RateStage>().box);
    double width = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) width = std::max(width, double(box(1, axis) - box(0, axis)));
    return width;
  };
  Points points = cloud(300, 7);
  const double clean = box_width(points);
  points.push_back({0, 60, 0});
  CHECK(box_width(points) == clean);
  points.back() = {0, 8, 0};  // the control: within the core
  CHECK(box_width(points) > 3 * clean);
}
