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
#include "support/short_embedding.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using EditedUnmarked = compmark::testing::SmallRecipe;
using Edited = EditedDecoder<LatticeDecoder<float>, CommonEdits>;
using EditedRecipe = recipes::Marked<EditedUnmarked, Edited>;
using EditedEmbedding = PosthocEmbedding<EditedRecipe, ThreadExecutor>;

Edited edited_colours(double none) {
  CommonEdits::Settings settings;
  settings.none = none;
  return {compmark::testing::colours(), settings};
}

}  // namespace

TEST_CASE("embed/edited_embedding: edits follow from seed and iteration, at any thread count and after a stop") {
  const compmark::testing::BlobViews views;
  ThreadExecutor two(2), one(1);
  const auto base = compmark::testing::briefly_trained<EditedUnmarked>(views, two);
  REQUIRE(base.ok());
  const TrainSettings settings = compmark::testing::short_embedding(24);
  const auto started = [&](ThreadExecutor& executor, double none) {
    EditedEmbedding embedding(settings, executor);
    set_watermark(embedding, edited_colours(none), compmark::testing::eight_bits);
    embedding.start_from(with_room_for_stages<EditedRecipe>(*base, 1));
    return embedding;
  };
  using compmark::testing::same_values;
  EditedEmbedding first = started(two, 0.15), second = started(one, 0.15), unedited = started(two, 1);
  REQUIRE(first.run(views));
  REQUIRE(second.run(views));
  REQUIRE(unedited.run(views));
  CHECK(same_values(first.model(), second.model()));
  CHECK(!same_values(first.model(), unedited.model()));  // negative control: the edits are in these bits

  const auto path = std::filesystem::temp_directory_path() / "compmark_test_edited.ckpt";
  EditedEmbedding stopped = started(two, 0.15);
  for (int i = 0; i < 9; ++i) REQUIRE(stopped.step(views).ok());
  REQUIRE(write_checkpoint(path, stopped.state(), settings, ModelInfo{}, 0).ok());
  auto loaded = read_checkpoint<EditedEmbedding>(path, settings, ModelInfo{});
  REQUIRE(loaded.ok());
  EditedEmbedding resumed(settings, two);
  set_watermark(resumed, edited_colours(0.15), compmark::testing::eight_bits);
  resumed.restore(std::move(loaded->state));
  REQUIRE(resumed.run(views));
  CHECK(same_values(resumed.model(), first.model()));
  std::filesystem::remove(path);
}
