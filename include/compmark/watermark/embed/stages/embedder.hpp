// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of an Embedder (watermark/decoder/concept.hpp): replaces the attribute that carries the mark by the marked
// one before an anchor is decoded. A mark of the geometry is embedded in every anchor before any is culled. A mark of
// the features is embedded in the anchors that are read: the visible ones, and all of them where an entropy model reads
// ancestors (ContextGS). Cost: that of the embedder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/anchor_overlay.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/residual.hpp"

namespace compmark {

template <class Embed>
struct EmbedderStage : Stage<EmbedderStage<Embed>> {
  using Arena = ParameterArena<typename Embed::Scalar>;
  using Own = StageOf<EmbedderStage>;
  using Handles = typename Embed::Handles;
  using Context = typename Embed::Context;
  struct Phase {
    bool embeds = true;  ///< false: the unmarked model's own attributes, as if nothing were hidden
  };
  static void leave_mark(Phase& phase) { phase.embeds = false; }
  static constexpr bool changes_attributes = true;
  static constexpr bool marks_geometry =
      Embed::target == AnchorAttribute::position || Embed::target == AnchorAttribute::scaling;

  [[nodiscard]] static Handles add_parameters(Arena& arena, const AnchorHandles& anchors, std::size_t /*views*/) {
    const auto table = attribute(anchor_values(std::as_const(arena), anchors), Embed::target);
    return Embed::add_parameters(arena, table.rows, table.columns);
  }
  static void set_schedules(Arena& arena, const Handles& blocks, const TrainSettings& settings) {
    const MarkNumbers& mark = settings.mark;
    arena.set_schedule(blocks.residual, {mark.residual.learning_rate, mark.residual.learning_rate * mark.residual.decay,
                                         RateUnit::one, mark.residual.after, mark.residual.after});
  }
  /// The mark moves into the attribute that carries it: same renders, nothing left to embed.
  static void bake(Arena& arena, const AnchorHandles& anchors, const Handles& blocks) {
    Embed::bake(attribute(anchor_values(arena, anchors), Embed::target), arena.values(blocks.residual));
  }

  template <class Pass, class Columns>
  static void before_culling(const Pass& pass, const Own& own, Columns& columns) {
    if constexpr (marks_geometry) embed(pass, own, OverlaidRows::all, columns);
  }
  template <class Pass, class Columns>
  static void attributes(const Pass& pass, const Own& own, Columns& columns) {
    if constexpr (!marks_geometry) {
      const bool all = Embed::target == AnchorAttribute::feature && pass.reads_all_features;
      embed(pass, own, all ? OverlaidRows::all : OverlaidRows::visible, columns);
    }
  }
  template <class Pass>
  static void attributes_backward(const Pass& pass, const Own& own) {
    if (!own.phase.embeds) return;
    auto& overlay = pass.context.overlay;
    Embed::backward(overlay.gradient(Embed::target, pass.model.arena, pass.model.anchors),
                    overlay.rows(Embed::target, std::as_const(pass.context.visible).span()),
                    pass.model.arena.gradients(own.blocks.residual), own.context, pass.executor);
  }

 private:
  template <class Pass, class Columns>
  static void embed(const Pass& pass, const Own& own, OverlaidRows rows, Columns& columns) {
    if (!own.phase.embeds) return;
    auto& overlay = pass.context.overlay;
    const auto marked = overlay.write(Embed::target, rows, columns);
    auto& plain = attribute(columns, Embed::target);
    Embed::forward(plain, pass.model.arena.values(own.blocks.residual),
                   overlay.rows(Embed::target, std::as_const(pass.context.visible).span()), marked, own.context,
                   pass.executor);
    plain = marked;
  }
};

}  // namespace compmark
