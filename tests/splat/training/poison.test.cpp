// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Poison fuzz over every parameter slot (docs/spec/numerics.md, TB1, BF9, ML4 and OP6): one bad value is planted in a
// model of every optional stage, one view goes forward, through the loss, backward and into an optimizer step, then the
// slot is healed. Every weight of every network is a slot, and every column of one visible anchor. The sanitized build
// runs this for its reports.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/pipeline.hpp>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "support/small_scene.hpp"

namespace {

using namespace compmark;

using testing::SmallRecipe;
struct Everything
    : DefaultRecipe<float,
                    DecoderShape{
                        .feature_dim = 8, .offsets = 3, .distance = true, .feature_bank = true, .appearance_dim = 4}> {
};

constexpr float float_infinity = std::numeric_limits<float>::infinity();
constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();
/// 88.8: exp overflows in the logarithmic columns. 1 / 255: the cut-off of opacities.
constexpr std::array<float, 16> poison{not_a_number, float_infinity, -float_infinity, 3e38f,  -1e38f, 1e30f,
                                       -1e30f,       1e20f,          88.8f,           -88.8f, 16.0f,  -16.0f,
                                       0.0f,         -0.0f,          1.0f / 255.0f,   1e-45f};

/// A few steps into a training: every block has gradients and moments.
template <class R>
struct Training {
  static constexpr int width = 24, height = 20;
  static constexpr std::size_t view = 1;
  Model<R> model;
  typename R::Optimizer optimizer;
  typename R::Optimizer::State state;
  typename Pipeline<R>::Context context;
  Pipeline<R> pipeline;
  SerialExecutor executor;
  Camera<double> camera = testing::ring_camera(view, 6, width, height);
  Buffer<float> target{3 * width * height};
  std::vector<double> rates;

  Training() {
    constexpr std::size_t anchors = 24;
    model.create(anchors, 2);
    R::GaussianDecoder::initialise(model.arena, model.decoder, 3);
    const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
    const auto points = testing::cloud(anchors, 4);
    for (std::size_t i = 0; i < anchors; ++i) {
      for (std::size_t a = 0; a < 3; ++a) columns.position(i, a) = 0.5f * points[i][a];
    }
    const Random random(11, 0, random_stage("poison model"));
    for (std::size_t i = 0; i < columns.offset.size(); ++i)
      columns.offset.data[i] = static_cast<float>(random.normal(i));
    for (std::size_t i = 0; i < columns.scaling.size(); ++i) columns.scaling.data[i] = -1.5f;
    for (std::size_t i = 0; i < columns.feature.size(); ++i)
      columns.feature.data[i] = static_cast<float>(random.normal(i + 9000));
    const ImageView<float> image{target.data(), 3, height, width};
    REQUIRE(testing::BlobViews{6, width, height}.load(view, image).ok());
    rates.assign(model.arena.layout().blocks().size(), 1e-3);
    rates[model.anchors.position.index] = 0;  // never trained
    optimizer.prepare(model.arena.layout(), state);
    for (int i = 0; i < 3; ++i) {
      static_cast<void>(forward_loss_backward());
      REQUIRE(step().skipped_blocks == 0);
    }
  }

  struct Passed {
    ForwardReport forward;
    LossReport loss;
    std::size_t non_finite_anchors = 0;
  };
  Passed forward_loss_backward() {
    Passed passed;
    passed.forward = pipeline.forward(model, camera, view, context, executor);
    passed.loss = pipeline.loss({target.data(), 3, height, width}, {}, context, executor);
    pipeline.backward(model, camera, view, context, executor);
    passed.non_finite_anchors = context.decoder.non_finite_anchors;
    return passed;
  }
  OptimizerReport step() { return optimizer.step(model.arena, rates, state, executor, {.zero_gradients_after = true}); }
  /// Blocks whose gradient cannot be squared: what the guard has to find (OP6).
  [[nodiscard]] std::vector<bool> bad_blocks() const {
    std::vector<bool> bad;
    for (const ArenaLayout::Block& block : model.arena.layout().blocks()) {
      bool found = false;
      for (const float g : model.arena.all_gradients().subspan(block.offset, block.size()))
        found = found || !std::isfinite(g * g);
      bad.push_back(found && rates[bad.size()] != 0);
    }
    return bad;
  }
};

bool same_bits(float a, float b) { return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b); }

}  // namespace

TEST_CASE_TEMPLATE("training/poison: one bad value in any parameter slot ruins no pixel and no other parameter", R,
                   SmallRecipe, Everything) {
  Training<R> training;
  const Model<R> clean = training.model;
  const typename R::Optimizer::State clean_state = training.state;
  const std::size_t clean_gaussians = training.forward_loss_backward().forward.gaussians;
  const std::vector<float> clean_image(training.context.image.flat().begin(), training.context.image.flat().end());
  const std::uint32_t anchor = training.context.visible[training.context.visible.size() / 2];
  const std::span<const ArenaLayout::Block> blocks = clean.arena.layout().blocks();
  const auto row_of = [&](const ArenaLayout::Block& block, std::uint32_t row) {
    return block.kind == RowKind::anchor ? std::pair(block.offset + row * block.columns, block.columns)
                                         : std::pair(block.offset, block.size());
  };

  std::size_t cases = 0, skipped = 0, counted = 0;
  for (const ArenaLayout::Block& planted : blocks) {
    const auto [first, count] = row_of(planted, anchor);
    for (std::size_t slot = first; slot < first + count; ++slot) {
      for (const float value : poison) {
        INFO(std::string(planted.name), ", slot ", slot - planted.offset, ", value ", value);
        Model<R>& model = training.model;
        model = clean;
        training.state = clean_state;
        model.arena.all_values()[slot] = value;
        const auto passed = training.forward_loss_backward();

        // The picture is finite (TB1, BF9), and no other anchor has caught anything.
        bool finite = true, same_image = true;
        for (std::size_t i = 0; i < clean_image.size(); ++i) {
          const float pixel = training.context.image.flat()[i];
          finite = finite && std::isfinite(pixel);
          same_image = same_image && same_bits(pixel, clean_image[i]);
        }
        REQUIRE(finite);
        for (const ArenaLayout::Block& block : blocks) {
          if (planted.kind != RowKind::anchor || block.kind != RowKind::anchor) continue;
          const std::size_t ill = row_of(block, anchor).first;
          for (std::size_t i = block.offset; i < block.offset + block.size(); ++i) {
            if (i < ill || i >= ill + block.columns) finite = finite && std::isfinite(model.arena.all_gradients()[i]);
          }
        }
        REQUIRE(finite);

        // The guard finds every bad block and nothing else (OP6): a skipped block keeps its bits and its step count, all others stay finite.
        const std::vector<bool> bad = training.bad_blocks();
        const auto bad_count = static_cast<std::size_t>(std::count(bad.begin(), bad.end(), true));
        const OptimizerReport stepped = training.step();
        REQUIRE(stepped.skipped_blocks == bad_count);
        bool kept = true;
        for (std::size_t b = 0; b < blocks.size(); ++b) {
          const bool moves = !bad[b] && training.rates[b] != 0;
          REQUIRE(training.state.steps[b] == clean_state.steps[b] + (moves ? 1u : 0u));
          for (std::size_t i = blocks[b].offset; i < blocks[b].offset + blocks[b].size(); ++i) {
            finite = finite && (i == slot || std::isfinite(model.arena.all_values()[i])) &&
                     std::isfinite(training.state.first_moment[i]) && std::isfinite(training.state.second_moment[i]);
            kept = kept && (moves || i == slot || same_bits(model.arena.all_values()[i], clean.arena.all_values()[i]));
          }
        }
        REQUIRE(finite);
        REQUIRE(kept);

        // A NaN is never drawn: its Gaussians are gone, or a stage has counted it, or the guard has (ML4). A harmless value is not reported.
        const bool told = passed.forward.raster.scrubbed > 0 || passed.non_finite_anchors > 0;
        if (std::isnan(value)) {
          REQUIRE((same_image || told || bad_count > 0 || passed.forward.gaussians < clean_gaussians));
        }
        if (std::abs(value) < 1e-30f) REQUIRE((!told && bad_count == 0));

        // Healed, the training goes on.
        model.arena.all_values()[slot] = clean.arena.all_values()[slot];
        REQUIRE(std::isfinite(training.forward_loss_backward().loss.total));
        REQUIRE(training.step().skipped_blocks == 0);
        ++cases;
        skipped += bad_count > 0 ? 1u : 0u;
        counted += told ? 1u : 0u;
      }
    }
  }
  MESSAGE(cases, " cases; the optimizer's guard acted in ", skipped, ", a stage counted bad values in ", counted);
  CHECK(skipped > 0);
  CHECK(counted > 0);
}
