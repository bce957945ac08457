// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Stages that change anchors, on a table of anchors alone: the part of a pass before the decoder, forward and backward, in the order of Pipeline.
#pragma once

#include <cstdint>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/anchor_overlay.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark::testing {

template <class T, class List>
struct StageScene;
template <class T, class... S>
struct StageScene<T, StageList<S...>> {
  using Stages = StageList<S...>;
  struct TableModel {
    ParameterArena<T> arena;
    AnchorHandles anchors;
    StageMembers<Stages, StageHandles> stages;
  };
  struct TableContext {
    AnchorOverlay<T> overlay;
    Buffer<std::uint32_t> visible;
    StageMembers<Stages, StageContext> stages;
  };
  template <class M, class E>
  struct TablePass {
    M& model;
    TableContext& context;
    E& executor;
    bool reads_all_features;
  };

  TableModel model;
  TableContext context;
  StageMembers<Stages, StagePhase> phases;
  StageMembers<Stages, StageItself> stages;

  StageScene(std::size_t anchors, const DecoderShape& shape) {
    model.anchors = add_anchor_blocks(model.arena, anchors, shape);
    Stages::forward(
        [&]<class Q>() { model.stages.template of<Q>() = Q::add_parameters(model.arena, model.anchors, 1); });
    Stages::forward([&]<class Q>() { Q::initialise(model.arena, model.stages.template of<Q>(), 3); });
  }
  void bake() {
    Stages::forward([&]<class Q>() { Q::bake(model.arena, model.anchors, model.stages.template of<Q>()); });
  }
  template <class Q>
  [[nodiscard]] StageOf<Q> own() {
    return {model.stages.template of<Q>(), phases.template of<Q>(), context.stages.template of<Q>()};
  }
  [[nodiscard]] bool reads_all() const {
    bool all = false;
    Stages::forward([&]<class Q>() { all = all || Q::reads_all_features(phases.template of<Q>()); });
    return all;
  }
  /// What the decoder would read of the visible anchors.
  template <class E>
  [[nodiscard]] AnchorColumns<const T> read(E& executor) {
    const TablePass<const TableModel, E> pass{model, context, executor, reads_all()};
    context.overlay.begin();
    AnchorColumns<const T> columns = anchor_values(std::as_const(model.arena), model.anchors);
    Stages::forward([&]<class Q>() { stages.template of<Q>().before_culling(pass, own<Q>(), columns); });
    Stages::forward([&]<class Q>() { stages.template of<Q>().attributes(pass, own<Q>(), columns); });
    return columns;
  }
  /// Where the decoder would add; carry() takes it on.
  template <class E>
  [[nodiscard]] AnchorColumns<T> gradients(E& executor) {
    return context.overlay.gradients(model.arena, model.anchors, std::as_const(context.visible).span(), executor);
  }
  template <class E>
  void carry(E& executor) {
    const TablePass<TableModel, E> pass{model, context, executor, reads_all()};
    Stages::backward([&]<class Q>() { stages.template of<Q>().attributes_backward(pass, own<Q>()); });
    context.overlay.add_to(model.arena, model.anchors, std::as_const(context.visible).span(), executor);
  }
};

}  // namespace compmark::testing
