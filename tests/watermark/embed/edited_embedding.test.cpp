// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A mark that is learned from edited renders (watermark/edit/edit_chain.hpp).
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/edit/edit_chain.hpp>
#include <compmark/watermark/embed/base_model.hpp>
#include <compmark/watermark/embed/posthoc_embedding.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "support/colour_decoder.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using EditedUnmarked = compmark::testing::SmallRecipe;
using Edited = EditedDecoder<LatticeDecoder<float>, CommonEdits>;
using EditedRecipe = recipes::Marked<EditedUnmarked, Edited>;
using EditedEmbedding = PosthocEmbedding<EditedRecipe, ThreadExecutor>;

TrainSettings edited_settings(std::int64_t iterations) {
  TrainSettings settings;
  settings.iterations = iterations;
  settings.seed = 4;
  settings.mark.message.after = settings.mark.residual.after = 0;
  settings.mark.message.ramp = 0;
  settings.mark.message.logit_scale = 1;
  settings.mark.message.hinge_margin = 0.2;
  settings.mark.message.novel_view_every = 1;
  settings.mark.message.lambda = 1;
  settings.mark.residual.learning_rate = 0.02;
  settings.mark.posthoc.fidelity = 60;
  return settings;
}
Edited edited_colours(double none) {
  CommonEdits::Settings settings;
  settings.none = none;
  return {compmark::testing::colours(), settings};
}

}  // namespace

TEST_CASE("embed/edited_embedding: edits follow from seed and iteration, at any thread count and after a stop") {
  const compmark::testing::BlobViews views;
  ThreadExecutor two(2), one(1);
  TrainSettings plain;
  plain.iterations = 20;
  plain.voxel_size = 0.05;
  Trainer<EditedUnmarked, ThreadExecutor> trainer(plain, views.size(), 1.0, two);
  REQUIRE(trainer.initialise(compmark::testing::cloud(300, 7)));
  REQUIRE(trainer.run(views));
  const std::vector<std::uint8_t> bits{1, 0, 0, 1, 1, 1, 0, 1};
  const TrainSettings settings = edited_settings(24);
  const auto started = [&](ThreadExecutor& executor, double none) {
    EditedEmbedding embedding(settings, executor);
    set_watermark(embedding, edited_colours(none), bits);
    embedding.start_from(with_room_for_stages<EditedRecipe>(trainer.model(), 1));
    return embedding;
  };
  const auto same = [](const auto& a, const auto& b) {
    return std::equal(a.arena.all_values().begin(), a.arena.all_values().end(), b.arena.all_values().begin(),
                      b.arena.all_values().end());
  };
  EditedEmbedding first = started(two, 0.15), second = started(one, 0.15), unedited = started(two, 1);
  REQUIRE(first.run(views));
  REQUIRE(second.run(views));
  REQUIRE(unedited.run(views));
  CHECK(same(first.model(), second.model()));
  CHECK(!same(first.model(), unedited.model()));  // negative control: the edits are in these bits

  const auto path = std::filesystem::temp_directory_path() / "compmark_test_edited.ckpt";
  EditedEmbedding stopped = started(two, 0.15);
  for (int i = 0; i < 9; ++i) REQUIRE(stopped.step(views).ok());
  REQUIRE(write_checkpoint(path, stopped.state(), settings, ModelInfo{}, 0).ok());
  auto loaded = read_checkpoint<EditedEmbedding>(path, settings, ModelInfo{});
  REQUIRE(loaded.ok());
  EditedEmbedding resumed(settings, two);
  set_watermark(resumed, edited_colours(0.15), bits);
  resumed.restore(std::move(loaded->state));
  REQUIRE(resumed.run(views));
  CHECK(same(resumed.model(), first.model()));
  std::filesystem::remove(path);
}
