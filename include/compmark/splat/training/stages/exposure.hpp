// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of an Exposure (splat/effect/concept.hpp): applies the photograph's exposure to the image, and fixes the
// gauge after a step. Cost: that of the exposure.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

template <class Map>
struct ExposureStage : Stage<ExposureStage<Map>> {
  using Arena = ParameterArena<typename Map::Scalar>;
  using Own = StageOf<ExposureStage>;
  using Handles = typename Map::Handles;
  using Context = typename Map::Context;

  [[nodiscard]] static Handles add_parameters(Arena& arena, const AnchorHandles& /*anchors*/, std::size_t views) {
    return Map::add_parameters(arena, views);
  }
  static void initialise(Arena& arena, const Handles& blocks, std::uint64_t /*seed*/) {
    Map::initialise(arena, blocks);
  }
  static void set_schedules(Arena& arena, const Handles& blocks, const TrainSettings& settings) {
    if constexpr (requires { blocks.affine; }) {
      const LearningRate& rate = settings.effects.exposure;
      arena.set_schedule(blocks.affine, {rate.initial, rate.final, RateUnit::one});
    }
  }
  /// Exposures that do not train keep their bits.
  template <class Rates>
  static void after_step(Arena& arena, const Handles& blocks, const Rates& rates) {
    if (rates[blocks.affine.index] != 0) Map::fix_gauge(arena, blocks);
  }

  template <class Pass>
  static void image(const Pass& pass, const Own& own) {
    Map::forward(pass.model.arena, own.blocks, pass.view, pass.context.image, own.context, pass.executor);
  }
  template <class Pass>
  static void image_backward(const Pass& pass, const Own& own) {
    Map::backward(pass.model.arena, own.blocks, pass.view, pass.context.d_image, own.context, pass.executor);
  }
};

}  // namespace compmark
