// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The road of the anchors before they are decoded: table -> Embedder (x + tanh x') -> DistortionLayer (noise of the quantizer's step), or the
// EntropyModel with the noise of its own step and its rate -> what the GaussianDecoder reads; and back. Attributes that a stage changes are
// written to a table of their own, rows that are not visible stay unwritten, but for marked features where the entropy model reads ancestors
// (ContextGS): these are all embedded. Attributes that nobody changes are read where they are. A recipe with none of these stages has no such
// table and no code here.
// Cost: one copy of a visible anchor's changed attributes, forward and backward; of marked ancestors the features of every anchor.
// Longer than 300 lines: which rows a stage wrote, and which gradients it is given back, are to be read in one place.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/anchor/concept.hpp"
#include "compmark/anchor/table.hpp"
#include "compmark/core/absent.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/entropy/concept.hpp"
#include "compmark/mark/concept.hpp"
#include "compmark/mark/residual.hpp"
#include "compmark/quant/concept.hpp"
#include "compmark/quant/distortion.hpp"

namespace compmark {

namespace detail {
/// Blocks of a stage in the arena; an empty type of its own where the stage is absent.
template <class Stage>
struct NoHandles {};
template <class Stage>
struct HandlesOf {
  using type = NoHandles<Stage>;
};
template <class Stage>
  requires(present<Stage>&& requires { typename Stage::Handles; })
struct HandlesOf<Stage> {
  using type = typename Stage::Handles;
};
}  // namespace detail
template <class Stage>
using StageHandles = typename detail::HandlesOf<Stage>::type;

namespace detail {
/// What the entropy model does in an iteration, what it found and what it left for the way back; nothing where there is none.
template <class Rate>
struct RateOfIteration {};
template <class Rate>
  requires present<Rate>
struct RateOfIteration<Rate> {
  typename Rate::Phase phase;  ///< the default, nothing, is that of every render
  typename Rate::Report report;
  typename Rate::Context context;
};
}  // namespace detail

/// T: scalar. Embed: Embedder, Distort: DistortionLayer, Rate: EntropyModel, any of which may be absent.
template <class T, class Embed, class Distort, class Rate = NoEntropyModel>
class AnchorRoad {
 public:
  static constexpr bool marks = present<Embed>;
  static constexpr bool distorts = present<Distort>;
  static constexpr bool rates = present<Rate>;
  static constexpr bool is_absent = !marks && !distorts && !rates;

  struct Handles {
    [[no_unique_address]] StageHandles<Embed> embedder;
    [[no_unique_address]] StageHandles<Distort> distortion;
    [[no_unique_address]] StageHandles<Rate> rate;
  };
  /// Changed attributes (in the order of MarkTarget) and their gradients, [N, C] each; only listed rows have a meaning.
  struct Context {
    std::array<Buffer<T>, 4> values, gradients;
    std::array<bool, 4> changed{};
    Buffer<std::uint32_t> all_rows;
    DistortionPhase phase;  ///< of this iteration; the default, nothing, is that of every render
    bool embeds = true;     ///< false: the host's own attributes, as if nothing were hidden; nothing else differs
    DistortionReport distortion;
    AnchorColumns<const T> read;  ///< what the decoder read in the last pass
    [[no_unique_address]] typename Embed::Context embedder;
    [[no_unique_address]] typename Distort::Context noise;
    [[no_unique_address]] detail::RateOfIteration<Rate> rate;
  };

  AnchorRoad() = default;
  explicit AnchorRoad(Distort distort) : distort_(std::move(distort)) {}
  explicit AnchorRoad(Rate rate) requires(rates) : rate_(std::move(rate)) {}

  /// Blocks of the stages, after those of the table and of the decoder.
  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& arena, const AnchorHandles& anchors) {
    Handles handles;
    if constexpr (marks) {
      const MatrixView<const T> table = attribute(anchor_values(std::as_const(arena), anchors), Embed::target);
      handles.embedder = Embed::add_parameters(arena, table.rows, table.columns);
    }
    if constexpr (distorts) handles.distortion = Distort::add_parameters(arena);
    if constexpr (rates) handles.rate = Rate::add_parameters(arena, anchor_count(arena.layout(), anchors));
    return handles;
  }
  static void initialise(ParameterArena<T>& arena, const Handles& handles, std::uint64_t seed) {
    if constexpr (distorts) Distort::initialise(arena, handles.distortion, seed);
    if constexpr (rates) Rate::initialise(arena, handles.rate, seed);
  }
  /// The watermark moves into the attribute that carries it: same renders, nothing left to embed.
  static void bake(ParameterArena<T>& arena, const AnchorHandles& anchors, const Handles& handles) {
    if constexpr (marks) {
      Embed::bake(attribute(anchor_values(arena, anchors), Embed::target), arena.values(handles.embedder.residual));
    }
  }

  /// What decides which anchors are visible. A watermark in the geometry is embedded in every row here, any other in forward().
  template <Executor E>
  [[nodiscard]] AnchorColumns<const T> before_culling(const ParameterArena<T>& arena, const AnchorHandles& anchors,
                                                      const Handles& handles, Context& context, E& executor) const {
    AnchorColumns<const T> columns = anchor_values(arena, anchors);
    context.changed = {};
    if constexpr (marks_geometry) {
      if (!context.embeds) return columns;
      list_all(columns, context);
      embed(arena, handles, std::as_const(context.all_rows).span(), columns, context, executor);
    }
    return columns;
  }

  /// What the decoder reads of the visible anchors. `columns` is before_culling's.
  template <Executor E>
  [[nodiscard]] AnchorColumns<const T> forward(const ParameterArena<T>& arena, const Handles& handles,
                                               std::span<const std::uint32_t> visible, AnchorColumns<const T> columns,
                                               Context& context, E& executor) const {
    if constexpr (reads_ancestors) {
      context.rate.context.all_features = embeds_ancestors(context);
      if (embeds_ancestors(context)) list_all(columns, context);
    }
    if constexpr (marks && !marks_geometry) {
      if (context.embeds) embed(arena, handles, rows_of(Embed::target, visible, context), columns, context, executor);
    }
    context.distortion = {};
    if constexpr (distorts) {
      if (context.phase.active()) {
        for (const MarkTarget which : {MarkTarget::feature, MarkTarget::scaling, MarkTarget::offset}) {
          copy(visible, which, columns, context, executor);
        }
        context.distortion =
            distort_.forward(arena, handles.distortion, visible, context.phase,
                             own(context, MarkTarget::feature, columns), own(context, MarkTarget::scaling, columns),
                             own(context, MarkTarget::offset, columns), context.noise, executor);
      }
    }
    if constexpr (rates) {
      context.rate.report = {};
      if (context.rate.phase.active()) {
        for (const MarkTarget which : {MarkTarget::feature, MarkTarget::scaling, MarkTarget::offset}) {
          copy(visible, which, columns, context, executor);
        }
        context.rate.report =
            rate_.forward(arena, handles.rate, visible, context.rate.phase, columns.position,
                          own(context, MarkTarget::feature, columns), own(context, MarkTarget::scaling, columns),
                          own(context, MarkTarget::offset, columns), context.rate.context, executor);
      }
    }
    return columns;
  }

  /// Where the decoder's backward adds: the arena's gradients, or cleared tables for what was changed.
  template <Executor E>
  [[nodiscard]] AnchorColumns<T> gradients(ParameterArena<T>& arena, const AnchorHandles& anchors,
                                           std::span<const std::uint32_t> visible, Context& context,
                                           E& executor) const {
    AnchorColumns<T> columns = anchor_gradients(arena, anchors);
    for (std::size_t which = 0; which < 4; ++which) {
      if (!context.changed[which]) continue;
      MatrixView<T>& table = attribute(columns, static_cast<MarkTarget>(which));
      context.gradients[which].resize(table.size());
      table.data = context.gradients[which].data();
      const std::span<const std::uint32_t> rows = rows_of(static_cast<MarkTarget>(which), visible, context);
      executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) std::fill_n(table.row(rows[i]), table.columns, T(0));
      });
    }
    return columns;
  }

  /// Carries what gradients() handed out on into the arena (adds).
  template <Executor E>
  void backward(ParameterArena<T>& arena, const AnchorHandles& anchors, const Handles& handles,
                std::span<const std::uint32_t> visible, Context& context, E& executor) const {
    AnchorColumns<T> target = anchor_gradients(arena, anchors);
    const auto changed = [&](MarkTarget which) {
      MatrixView<T> table = attribute(target, which);
      table.data = context.gradients[static_cast<std::size_t>(which)].data();
      return table;
    };
    if constexpr (rates) {
      if (context.rate.phase.active()) {
        rate_.backward(arena, handles.rate, visible, changed(MarkTarget::feature), changed(MarkTarget::scaling),
                       changed(MarkTarget::offset), context.rate.context, executor);
      }
    }
    if constexpr (distorts) {
      if (context.phase.active()) {
        distort_.backward(arena, handles.distortion, visible, changed(MarkTarget::feature),
                          changed(MarkTarget::scaling), context.noise, executor);
      }
    }
    if constexpr (marks) {
      if (context.embeds) {
        Embed::backward(changed(Embed::target), rows_of(Embed::target, visible, context),
                        arena.gradients(handles.embedder.residual), context.embedder, executor);
      }
    }
    for (std::size_t which = 0; which < 4; ++which) {
      if (!context.changed[which]) continue;
      const MatrixView<const T> source = changed(static_cast<MarkTarget>(which));
      const MatrixView<T> into = attribute(target, static_cast<MarkTarget>(which));
      const std::span<const std::uint32_t> rows = rows_of(static_cast<MarkTarget>(which), visible, context);
      executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) {
          const T* const from = source.row(rows[i]);
          T* const to = into.row(rows[i]);
          for (std::size_t c = 0; c < source.columns; ++c) to[c] += from[c];
        }
      });
    }
  }

 private:
  static constexpr std::size_t grain = 1024;  // rows
  static constexpr bool marks_geometry = [] {
    if constexpr (marks) {
      return Embed::target == MarkTarget::position || Embed::target == MarkTarget::scaling;
    } else {
      return false;
    }
  }();

  template <class Columns>
  [[nodiscard]] static auto& attribute(Columns&& columns, MarkTarget which) {
    switch (which) {
      case MarkTarget::position:
        return columns.position;
      case MarkTarget::scaling:
        return columns.scaling;
      case MarkTarget::offset:
        return columns.offset;
      case MarkTarget::feature:
        break;
    }
    return columns.feature;
  }
  /// Whether the entropy model reads anchors that are not visible, ancestors, and these carry the mark.
  static constexpr bool reads_ancestors = [] {
    if constexpr (marks && rates && !marks_geometry) {
      return Embed::target == MarkTarget::feature && requires(typename Rate::Context c) { c.all_features; };
    } else {
      return false;
    }
  }();
  [[nodiscard]] static bool embeds_ancestors(const Context& context) {
    if constexpr (reads_ancestors) return context.embeds && context.rate.phase.active();
    return false;
  }
  static void list_all(const AnchorColumns<const T>& columns, Context& context) {
    context.all_rows.resize(columns.rows());
    for (std::size_t i = 0; i < columns.rows(); ++i) context.all_rows[i] = static_cast<std::uint32_t>(i);
  }
  /// Rows that were written: all of them where the geometry is marked, or ancestors are.
  [[nodiscard]] static std::span<const std::uint32_t> rows_of(MarkTarget which, std::span<const std::uint32_t> visible,
                                                              const Context& context) {
    if constexpr (marks_geometry) {
      if (which == Embed::target && context.embeds) return context.all_rows.span();
    }
    if constexpr (reads_ancestors) {
      if (which == Embed::target && embeds_ancestors(context)) return context.all_rows.span();
    }
    return visible;
  }
  /// The context's table of an attribute, shaped like `columns`'.
  [[nodiscard]] static MatrixView<T> own(Context& context, MarkTarget which, const AnchorColumns<const T>& columns) {
    const MatrixView<const T>& shape = attribute(columns, which);
    Buffer<T>& storage = context.values[static_cast<std::size_t>(which)];
    storage.resize(shape.size());
    return {storage.data(), shape.rows, shape.columns};
  }
  template <Executor E>
  static void embed(const ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                    AnchorColumns<const T>& columns, Context& context, E& executor) {
    const MatrixView<T> table = own(context, Embed::target, columns);
    MatrixView<const T>& plain = attribute(columns, Embed::target);
    Embed::forward(plain, arena.values(handles.embedder.residual), rows, table, context.embedder, executor);
    plain = table;
    context.changed[static_cast<std::size_t>(Embed::target)] = true;
  }
  template <Executor E>
  static void copy(std::span<const std::uint32_t> rows, MarkTarget which, AnchorColumns<const T>& columns,
                   Context& context, E& executor) {
    if (context.changed[static_cast<std::size_t>(which)]) return;
    const MatrixView<T> table = own(context, which, columns);
    MatrixView<const T>& plain = attribute(columns, which);
    executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) std::copy_n(plain.row(rows[i]), plain.columns, table.row(rows[i]));
    });
    plain = table;
    context.changed[static_cast<std::size_t>(which)] = true;
  }

  [[no_unique_address]] Distort distort_;
  [[no_unique_address]] Rate rate_;
};

}  // namespace compmark
