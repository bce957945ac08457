// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/embed/stages/lost_anchors.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/embed/base_model.hpp>
#include <compmark/watermark/embed/posthoc_embedding.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "support/colour_decoder.hpp"
#include "support/short_embedding.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using LosingBase = compmark::testing::SmallRecipe;
using Losing = recipes::WithLostAnchors<recipes::Marked<LosingBase, LatticeDecoder<float>>>;
using LosingEmbedding = PosthocEmbedding<Losing, ThreadExecutor>;

TrainSettings losing_settings(double lost) {
  TrainSettings settings = compmark::testing::short_embedding(30);
  settings.mark.posthoc.lost_anchors = lost;
  return settings;
}
Buffer<std::uint32_t> all_rows(std::size_t count) {
  Buffer<std::uint32_t> rows;
  rows.resize(count);
  for (std::size_t i = 0; i < count; ++i) rows[i] = static_cast<std::uint32_t>(i);
  return rows;
}

/// The readings, of as many as there are iterations, that lack anchors.
std::size_t readings_lacking_anchors(const TrainSettings& settings) {
  LostAnchorsStage stage;
  stage.configure<Losing>(settings);
  std::size_t count = 0;
  for (std::int64_t t = 1; t <= settings.iterations; ++t) {
    LostAnchorsStage::Phase phase;
    stage.set_phase({t, settings.iterations, settings.seed}, phase);
    count += phase.share > 0 ? 1 : 0;
  }
  return count;
}

}  // namespace

TEST_CASE(
    "embed/lost_anchors: one reading of three lacks anchors, up to the largest share, drawn by seed and iteration") {
  LostAnchorsStage stage;
  stage.configure<Losing>(losing_settings(0.6));
  int readings = 0;
  double largest = 0;
  for (std::int64_t t = 1; t <= 3000; ++t) {
    LostAnchorsStage::Phase phase, again;
    stage.set_phase({t, 3000, 9}, phase);
    stage.set_phase({t, 3000, 9}, again);
    REQUIRE(phase.share == again.share);
    readings += phase.share > 0 ? 1 : 0;
    largest = std::max(largest, phase.share);
    if (!(phase.share > 0)) continue;
    Buffer<std::uint32_t> rows = all_rows(4000);
    LostAnchorsStage::choose_visible(phase, rows);
    CHECK(std::is_sorted(rows.begin(), rows.end()));
    // Six deviations of a binomial count.
    CHECK(std::abs(static_cast<double>(rows.size()) - 4000 * (1 - phase.share)) < 6 * 0.5 * std::sqrt(4000.0));
  }
  CHECK(std::abs(readings - 1000) < 6 * std::sqrt(3000.0 * 2 / 9));
  CHECK(largest > 0.55);
  CHECK(largest <= 0.6);

  // In the loss of the photographs nothing is lost, and neither without the number.
  TrainSettings photographs = losing_settings(0.6);
  photographs.mark.posthoc.fidelity = 0;
  for (const TrainSettings& settings : {photographs, losing_settings(0)}) {
    stage.configure<Losing>(settings);
    for (std::int64_t t = 1; t <= 30; ++t) {
      LostAnchorsStage::Phase phase;
      stage.set_phase({t, 30, 9}, phase);
      CHECK(phase.share == 0);
    }
  }
}

TEST_CASE("embed/lost_anchors: the marked and the unmarked render lack the same anchors, at any thread count") {
  const compmark::testing::BlobViews views;
  ThreadExecutor two(2), one(1);
  const auto base = compmark::testing::briefly_trained<LosingBase>(views, two);
  REQUIRE(base.ok());
  const auto started = [&](ThreadExecutor& executor, TrainSettings settings) {
    LosingEmbedding embedding(settings, executor);
    set_watermark(embedding, compmark::testing::colours(), compmark::testing::eight_bits);
    embedding.start_from(with_room_for_stages<Losing>(*base, 1));
    return embedding;
  };
  // A mark that is not learned: the renders are alike whatever is lost, and fewer anchors are seen.
  TrainSettings still = losing_settings(0.8);
  still.mark.residual.learning_rate = 0;
  LosingEmbedding unmoved = started(two, still), whole = started(two, losing_settings(0));
  std::size_t fewer = 0;
  for (int i = 0; i < 30; ++i) {
    const auto report = unmoved.step(views), all = whole.step(views);
    REQUIRE(report.ok());
    REQUIRE(all.ok());
    CHECK(unmoved.reading().report().distortion == 0);
    fewer += report->forward.visible_anchors < all->forward.visible_anchors ? 1 : 0;
  }
  CHECK(fewer >= 3);
  CHECK(fewer <= 20);

  // Held to photographs, a render that lacks anchors is still compared with the unmarked one that lacks them: the difference to a photograph, which the
  // other readings have, would teach the mark to put back what is missing.
  TrainSettings photographed = still;
  photographed.mark.posthoc.photograph_share = 1;
  LosingEmbedding by_photographs = started(two, photographed);
  std::size_t held_to_unmarked = 0;
  for (int i = 0; i < 30; ++i) {
    const auto report = by_photographs.step(views);
    REQUIRE(report.ok());
    held_to_unmarked += by_photographs.reading().report().distortion == 0 ? 1 : 0;
  }
  CHECK(held_to_unmarked == readings_lacking_anchors(photographed));
  CHECK(held_to_unmarked >= 3);
  CHECK(held_to_unmarked <= 20);

  LosingEmbedding first = started(two, losing_settings(0.6)), second = started(one, losing_settings(0.6));
  REQUIRE(first.run(views));
  REQUIRE(second.run(views));
  using compmark::testing::same_values;
  CHECK(same_values(first.model(), second.model()));
  REQUIRE(whole.state().iteration == 30);
  CHECK(!same_values(first.model(), whole.model()));  // the control: what is lost is in these bits
}
