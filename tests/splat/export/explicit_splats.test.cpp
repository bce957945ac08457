// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Models of explicit Gaussians: to a 3DGS file and back, their training, and a mark in one that came from a file.
#include "compmark/splat/export/explicit_splats.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/splat_ply.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/recipes/explicit.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/splat/export/bake.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/embed/base_model.hpp>
#include <compmark/watermark/embed/posthoc_embedding.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <utility>
#include <vector>

#include "support/colour_decoder.hpp"
#include "support/short_training.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;

/// A table as strangers write it: any norm of the rotations, flat and opaque Gaussians.
SplatTable strange_table(int degree) {
  SplatTable table;
  table.resize(60, degree);
  std::size_t n = 0;
  const Random random(4, 4, 4);
  table.for_each_column([&](std::vector<float>& column) {
    for (float& value : column) value = static_cast<float>(0.5 * random.normal(n++));
  });
  for (std::vector<float>& column : table.log_scale)
    for (float& value : column) value -= 2.5f;
  table.log_scale[1][7] = -std::numeric_limits<float>::infinity();
  table.opacity[8] = std::numeric_limits<float>::infinity();
  return table;
}

struct TrainedSplats : ExplicitRecipe<float, 1> {};

Model<TrainedSplats> trained_splats(std::size_t threads, std::int64_t iterations, double& db) {
  TrainSettings settings;
  settings.iterations = iterations;
  settings.voxel_size = 0.05;
  settings.grow_interval = 20;
  settings.grow_after = settings.statistics_after = 3000;
  settings.grow_until = 20000;
  const compmark::testing::BlobViews views;
  ThreadExecutor executor(threads);
  Trainer<TrainedSplats, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
  REQUIRE(trainer.initialise(compmark::testing::cloud(400, 7)));
  REQUIRE(trainer.run(views));
  db = psnr(trainer.image(), trainer.target());
  return trainer.model();
}

}  // namespace

TEST_CASE("export/explicit_splats: any table becomes a model that shows what a viewer shows") {
  const SplatTable table = strange_table(2);
  const Result<Model<recipes::Explicit>> model = model_from_splats<recipes::Explicit>(table);
  REQUIRE(model.ok());
  const Camera<double> camera{
      .width = 90, .height = 70, .fx = 80, .fy = 80, .cx = 45, .cy = 35, .center_world = {0.1, 0, -3}};
  SerialExecutor executor;
  const Pipeline<recipes::Explicit> pipeline;
  Pipeline<recipes::Explicit>::Context context;
  const ForwardReport report = pipeline.forward(*model, camera, 0, context, executor);
  CHECK(report.gaussians > 40);
  SplatRenderer<recipes::Explicit> viewer(model->render);
  const auto shown = viewer.render(table, camera, executor);
  float most = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) most = std::max(most, std::abs(shown.data[i] - context.image.data[i]));
  CHECK(most < 1e-5f);
  // And back: the same numbers, rotations normalised.
  const SplatTable again = explicit_splats(*model);
  REQUIRE(again.count == table.count);
  CHECK(again.degree == 3);
  double apart = 0;
  for (std::size_t row = 0; row < table.count; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      CHECK(again.mean[axis][row] == table.mean[axis][row]);
      if (row != 7) CHECK(again.log_scale[axis][row] == table.log_scale[axis][row]);
      for (std::size_t i = 0; i < 9; ++i)
        apart = std::max(apart, std::abs(static_cast<double>(again.color(axis, i)[row] - table.color(axis, i)[row])));
      CHECK(again.color(axis, 12)[row] == 0);
    }
    if (row != 8) apart = std::max(apart, std::abs(static_cast<double>(again.opacity[row] - table.opacity[row])));
  }
  CHECK(apart < 1e-6);
  CHECK(std::isfinite(again.log_scale[1][7]));
  CHECK(std::isfinite(again.opacity[8]));
}

TEST_CASE("export/explicit_splats: a table that the recipe cannot hold is an error") {
  struct Flat : ExplicitRecipe<float, 0> {};
  const Result<Model<Flat>> model = model_from_splats<Flat>(strange_table(2));
  REQUIRE(!model.ok());
  CHECK(model.error().field == "f_rest");
  CHECK(model_from_splats<Flat>(strange_table(0)).ok());
  CHECK(!model_from_splats<Flat>(SplatTable{}).ok());
}

TEST_CASE("export/explicit_splats: a model is trained and grows, the same at any number of threads") {
  double first = 0, db = 0, again = 0;
  static_cast<void>(trained_splats(2, 1, first));
  const std::int64_t iterations = compmark::testing::short_trainings ? 40 : 400;
  const Model<TrainedSplats> model = trained_splats(1, iterations, db);
  const Model<TrainedSplats> twin = trained_splats(3, iterations, again);
  CHECK(std::equal(model.arena.all_values().begin(), model.arena.all_values().end(), twin.arena.all_values().begin(),
                   twin.arena.all_values().end()));
  MESSAGE("the last view: ", first, " dB untrained, ", db, " dB trained; ", model.anchor_count(), " Gaussians");
  if (compmark::testing::short_trainings) return;
  CHECK(db > first + 8);
  CHECK(model.anchor_count() != 400);
}

TEST_CASE("export/explicit_splats: a splat that came from a file carries a mark, and goes back into a file with it") {
  double db = 0;
  const SplatTable table = explicit_splats(trained_splats(2, compmark::testing::short_trainings ? 40 : 300, db));
  using Marked = recipes::Marked<TrainedSplats, LatticeDecoder<float>>;
  const Result<Model<TrainedSplats>> stranger = model_from_splats<TrainedSplats>(table);
  REQUIRE(stranger.ok());

  TrainSettings settings;
  settings.iterations = compmark::testing::short_trainings ? 10 : 400;
  settings.mark.message.after = settings.mark.residual.after = 0;
  settings.mark.message.ramp = 0;
  settings.mark.message.logit_scale = 1;
  settings.mark.message.hinge_margin = 0.2;
  settings.mark.message.novel_view_every = 1;
  settings.mark.message.lambda = 1;
  settings.mark.residual.learning_rate = 0.1;
  settings.mark.residual.decay = 0.1;
  settings.mark.posthoc.fidelity = 20;
  const std::vector<std::uint8_t> bits{1, 0, 0, 1, 1, 1, 0, 1};
  const compmark::testing::BlobViews views;
  ThreadExecutor executor(2);
  PosthocEmbedding<Marked, ThreadExecutor> embedding(settings, executor);
  set_watermark(embedding, compmark::testing::colours(), bits);
  embedding.start_from(with_room_for_stages<Marked>(*stranger, 1));
  REQUIRE(embedding.run(views));

  // What a reader sees of the file: its Gaussians, by a viewer's formula.
  const auto read = [&](const SplatTable& splats) {
    SplatRenderer<TrainedSplats> viewer(stranger->render);
    std::size_t right = 0;
    for (std::size_t i = 0; i < 24; ++i) {
      const auto image = viewer.render(splats, compmark::testing::ring_camera(i, 24, 48, 40), executor);
      LatticeDecoder<float>::Context context;
      std::vector<float> logits(8);
      compmark::testing::colours().forward(image, logits, context, executor);
      for (std::size_t b = 0; b < 8; ++b) right += (logits[b] > 0) == (bits[b] == 1) ? 1 : 0;
    }
    return static_cast<double>(right) / (24 * 8);
  };
  const double without = read(table), with = read(explicit_splats(baked_model(embedding.model())));
  MESSAGE("bits in the file's pictures: ", without, " without the mark, ", with, " with it");
  if (compmark::testing::short_trainings) return;
  CHECK(without < 0.75);  // negative control
  CHECK(with > without + 0.15);
}
