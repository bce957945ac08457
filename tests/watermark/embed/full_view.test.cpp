// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A view that the rasterizer has no memory for is background, and no reading of a message: where a message is read or
// learned, its error is returned.
#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/marked.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "compmark/testing/archetypes.hpp"
#include "compmark/watermark/baselines/unmarked_views.hpp"
#include "compmark/watermark/embed/posthoc_embedding.hpp"
#include "compmark/watermark/embed/read_model.hpp"
#include "support/colour_decoder.hpp"
#include "support/full_rasterizer.hpp"
#include "support/short_embedding.hpp"
#include "support/small_scene.hpp"

namespace full_view_test {

using namespace compmark;
using testing::BlobViews, testing::FullRasterizer, testing::SmallRecipe;

/// The cameras of the ring are 3 from its axis, those between them nearer.
constexpr bool between(const Camera<float>& camera) {
  const double x = camera.center_world[0], z = camera.center_world[2];
  return x * x + z * z < 8.999 || x * x + z * z > 9.001;
}
constexpr bool second_of_six(const Camera<float>& camera) {
  return camera.center_world[0] > 2 && camera.center_world[2] < -1;
}

template <auto full>
struct Full : SmallRecipe {
  using Rasterizer = FullRasterizer<SmallRecipe::Rasterizer, full>;
};
template <auto full>
using MarkedFull = recipes::Marked<Full<full>, LatticeDecoder<float>>;

template <class R>
Trainer<R, ThreadExecutor> marked_trainer(const BlobViews& views, ThreadExecutor& executor) {
  TrainSettings settings;
  settings.iterations = 20;
  settings.voxel_size = 0.05;
  settings.mark.message.after = settings.mark.residual.after = 0;
  settings.mark.message.ramp = 0;
  settings.mark.message.novel_view_every = 3;
  Trainer<R, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
  set_watermark(trainer, testing::colours(), testing::eight_bits);
  REQUIRE(trainer.initialise(testing::cloud(300, 7)).ok());
  return trainer;
}

TEST_CASE("embed/full_view: a reading of the renders is the error of the view that could not be drawn") {
  const BlobViews views;
  ThreadExecutor executor(2);
  const auto model = testing::briefly_trained<Full<second_of_six>>(BlobViews{.count = 1}, executor);
  REQUIRE(model.ok());
  const auto refused = read_model(*model, views, testing::colours(), executor);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK(read_model(*model, BlobViews{.count = 1}, testing::colours(), executor).ok());  // control

  UnmarkedViews unmarked(*model, views, executor);
  std::vector<float> pixels(std::size_t{3} * 48 * 40);
  const ImageView<float> image{pixels.data(), 3, 40, 48};
  CHECK(unmarked.load(0, image).ok());
  CHECK_FALSE(unmarked.load(1, image).ok());
}

TEST_CASE("embed/full_view: a training ends at the view between photographs that could not be drawn") {
  BlobViews views;
  ThreadExecutor executor(2);
  auto trainer = marked_trainer<MarkedFull<between>>(views, executor);
  const Result<Done> ran = trainer.run(views);
  REQUIRE_FALSE(ran.ok());
  CHECK(ran.error().kind == ErrorKind::exhausted);
  CHECK(trainer.state().iteration == 2);  // the third reads between
}

TEST_CASE("embed/full_view: so does post-hoc embedding, and has changed nothing") {
  BlobViews views;
  ThreadExecutor executor(2);
  using R = MarkedFull<between>;
  auto base = testing::briefly_trained<Full<between>>(views, executor);
  REQUIRE(base.ok());
  PosthocEmbedding<R, ThreadExecutor> embedding(testing::short_embedding(5), executor);
  set_watermark(embedding, testing::colours(), testing::eight_bits);
  embedding.start_from(with_room_for_stages<R>(*base, 4));
  const Model<R> before = embedding.model();
  const auto refused = embedding.step(views);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK(embedding.state().iteration == 0);
  CHECK(testing::same_values(before, embedding.model()));
  CHECK(embedding.reading().report().bits == 0);
  for (const float gradient : embedding.model().arena.all_gradients()) REQUIRE(gradient == 0);
}

TEST_CASE("embed/full_view: growth statistics hold the photograph of a failed step, once for each time") {
  BlobViews views;
  ThreadExecutor executor(2);
  auto trainer = marked_trainer<MarkedFull<between>>(views, executor);
  REQUIRE(trainer.step(views).ok());
  REQUIRE(trainer.step(views).ok());
  const auto visits = [&] {
    double sum = 0;
    for (const float count : trainer.state().growth.statistics.visits) sum += static_cast<double>(count);
    return sum;
  };
  std::vector<double> after{visits()};
  for (int tried = 0; tried < 2; ++tried) {
    REQUIRE_FALSE(trainer.step(views).ok());
    CHECK(trainer.state().iteration == 2);
    after.push_back(visits());
  }
  CHECK(after[0] > 0);
  CHECK(after[1] > after[0]);
  CHECK(after[2] - after[1] == after[1] - after[0]);
}

}  // namespace full_view_test
