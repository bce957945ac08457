// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model: everything that a render needs and nothing else. It has the anchors, the decoder's networks, and a few
// numbers. Training state (moments, statistics, schedule) is in the Trainer and in its checkpoint.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

/// Numbers of the render that were fixed in training; stored in the model file.
struct RenderSettings {
  double near_plane = 0.2;     ///< camera z below which nothing is drawn, world units
  double blur_variance = 0.3;  ///< screen-space low-pass, pixels^2
  std::array<double, 3> background{0, 0, 0};
};

template <Recipe R>
struct Model {
  using Scalar = typename R::Scalar;
  using Decoder = typename R::GaussianDecoder;

  ParameterArena<Scalar> arena;
  AnchorHandles anchors;
  typename Decoder::Handles decoder;
  using Stages = RecipeStages<R>;
  [[no_unique_address]] StageMembers<Stages, StageHandles> stages;  ///< blocks of the stages, after the decoder's
  RenderSettings render;
  double voxel_size = 0.001;    ///< world units; cell size of growing
  std::size_t train_views = 0;  ///< rows of the appearance table, if the recipe has one

  /// Blocks for `rows` anchors, all values zero.
  void create(std::size_t rows, std::size_t views) {
    check_recipe<R>();
    train_views = views;
    arena = {};
    anchors = R::AnchorModel::add_parameters(arena, rows);
    decoder = Decoder::add_parameters(arena, views);
    Stages::forward([&]<class S>() { blocks<S>() = S::add_parameters(arena, anchors, views); });
  }
  /// The blocks that have rows for each view, and how many: a file is asked for them before create() takes memory.
  [[nodiscard]] static std::vector<std::pair<std::string, std::size_t>> blocks_of_views() {
    Model none, one;
    none.create(0, 0);
    one.create(0, 1);
    std::vector<std::pair<std::string, std::size_t>> found;
    const std::span<const ArenaLayout::Block> before = none.arena.layout().blocks(),
                                              after = one.arena.layout().blocks();
    for (std::size_t i = 0; i < after.size(); ++i) {
      if (after[i].rows != before[i].rows) found.emplace_back(after[i].name, after[i].rows - before[i].rows);
    }
    return found;
  }
  /// First values of the blocks of all stages.
  void initialise_stages(std::uint64_t seed) {
    Stages::forward([&]<class S>() { S::initialise(arena, blocks<S>(), seed); });
  }
  /// Bakes a stage into the anchors, where it can: same renders, nothing left to add.
  void bake_stages() {
    Stages::forward([&]<class S>() { S::bake(arena, anchors, blocks<S>()); });
  }
  /// The blocks of a stage, by its type or its template: blocks<EmbedderStage>().residual.
  template <class S>
  [[nodiscard]] auto& blocks() {
    return stages.template of<S>();
  }
  template <class S>
  [[nodiscard]] const auto& blocks() const {
    return stages.template of<S>();
  }
  template <template <class...> class S>
  [[nodiscard]] auto& blocks() {
    return stages.template of<S>();
  }
  template <template <class...> class S>
  [[nodiscard]] const auto& blocks() const {
    return stages.template of<S>();
  }
  [[nodiscard]] std::size_t anchor_count() const { return compmark::anchor_count(arena.layout(), anchors); }
  [[nodiscard]] AnchorColumns<const Scalar> columns() const { return anchor_values(arena, anchors); }
};

}  // namespace compmark
