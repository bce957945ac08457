// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Adam (Kingma and Ba, arXiv 1412.6980) with the conventions of PyTorch, in one pass over memory. With t the step count
// of the block,
//     m += (1 - beta1) (g - m)        v = beta2 v + (1 - beta2) g^2
//     p -= lr / (1 - beta1^t)  *  m / (sqrt(v) / sqrt(1 - beta2^t) + epsilon)
// epsilon = 1e-15 as in the published recipes: a constant gradient of 1e-12 still moves a parameter by lr
// (docs/spec/numerics.md, OP1). The bias corrections are doubles from expm1 (OP3), one step count a block, which
// growing does not reset (docs/spec/method.md, 3.2). Dense: a row without gradient drifts by its old momentum, as
// published (docs/spec/numerics.md, OP4); one that never had a gradient keeps its bits, 0 / (0 + 1e-15).
//
// Guard (OP6): a block with a gradient whose square is not finite (NaN, infinity, |g| > 1.8e19) is left out of this
// step and counted; its step count stays. Hence moments are always finite. The price is one read of the gradients
// first. Underflow (OP2): a moment whose next step would hold a denormal number becomes zero: v below twice the
// smallest normal number, m below that over 1 - beta1, because a build without fused multiply-add rounds (1 - beta1) m
// on its own. Without it the m of a row that is out of sight turns denormal after ~800 steps and rounds to itself for
// ever, at a hundred cycles a step. Then flush-to-zero mode changes no bit for |g| >= 1e-15 (beta2 >= 1/2), and the
// update differs from exact Adam by less than lr / 100 where |g| < 1e-17.
//
// Cost: 28 bytes a parameter (read p, g, m, v; write p, m, v), 4 for the guard, 4 to zero the gradient; a square root
// and a division.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/optim/concept.hpp"

namespace compmark {

using AdamReport = OptimizerReport;

struct AdamSettings {
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-15;
};

/// Moments in the arena's layout, and one step count a block: all that a checkpoint needs.
template <class T>
struct AdamState {
  Buffer<T> first_moment;
  Buffer<T> second_moment;
  std::vector<std::uint64_t> steps;

  /// Work space of a step, without meaning between two of them.
  struct Scratch {
    struct Chunk {
      std::size_t block, begin, end;  ///< a range of scalars of the arena
    };
    struct Coefficients {
      bool stepped = false;
      T step_size{};     ///< lr / (1 - beta1^t)
      T inverse_root{};  ///< 1 / sqrt(1 - beta2^t)
    };
    std::vector<Chunk> chunks;
    std::vector<Coefficients> coefficients;
    Buffer<std::uint8_t> finite;
    Buffer<T> spare;
  } scratch;
};

/// Fresh moments and step count of one block, for a block whose values begin anew.
template <class T>
void forget_block(const ArenaLayout& layout, BlockHandle block, AdamState<T>& state) {
  const ArenaLayout::Block& forgotten = layout.block(block);
  for (Buffer<T>* moment : {&state.first_moment, &state.second_moment})
    std::fill_n(moment->data() + forgotten.offset, forgotten.size(), T{});
  state.steps[block.index] = 0;
}

namespace detail {

/// Fresh state, and moments that follow a row edit: shared by Adam and its reference.
template <class T>
void prepare_adam(const ArenaLayout& layout, AdamState<T>& state) {
  state.first_moment.resize(layout.size(), T{});
  state.second_moment.resize(layout.size(), T{});
  state.steps.assign(layout.blocks().size(), 0);
}
template <class T>
void edit_adam_rows(const RowEdit& edit, const ArenaLayout& old_layout, const ArenaLayout& new_layout,
                    AdamState<T>& state) {
  for (Buffer<T>* moment : {&state.first_moment, &state.second_moment}) {
    state.scratch.spare.resize(new_layout.size());
    move_rows<T>(old_layout, new_layout, edit, std::as_const(*moment).span(), state.scratch.spare.span());
    std::swap(*moment, state.scratch.spare);
  }
}
/// The smallest first moment that is kept: (1 - beta1) m is then a normal number, so no build and no floating-point
/// mode loses it.
template <class T>
[[nodiscard]] T smallest_first_moment(const AdamSettings& settings) {
  return 2 * std::numeric_limits<T>::min() / static_cast<T>(1 - settings.beta1);
}
/// 1 - beta^t without cancellation.
[[nodiscard]] inline double bias_correction(double beta, std::uint64_t steps) {
  return -std::expm1(static_cast<double>(steps) * std::log(beta));
}

}  // namespace detail

/// W lanes at a time; the result does not depend on W. Chunks are fixed, elements independent: same bits at any thread
/// count.
template <class T, int W = native_width<T>>
class Adam {
 public:
  using Scalar = T;
  using Settings = AdamSettings;
  using State = AdamState<T>;

  Adam() = default;
  explicit Adam(Settings settings) : settings_(settings) {}
  [[nodiscard]] const Settings& settings() const { return settings_; }

  void prepare(const ArenaLayout& layout, State& state) const { detail::prepare_adam(layout, state); }

  void edit_rows(const RowEdit& edit, const ArenaLayout& old_layout, const ArenaLayout& new_layout,
                 State& state) const {
    detail::edit_adam_rows(edit, old_layout, new_layout, state);
  }

  /// rates: one learning rate a block; at 0 the block is left out entirely (values, moments and step count keep their
  /// bits).
  template <Executor E>
  AdamReport step(ParameterArena<T>& arena, std::span<const double> rates, State& state, E& executor,
                  StepOptions options = {}) const {
    const std::span<const ArenaLayout::Block> blocks = arena.layout().blocks();
    COMPMARK_ASSERT(rates.size() == blocks.size(), "Adam::step: one rate a block");
    COMPMARK_ASSERT(state.first_moment.size() == arena.layout().size(),
                    "Adam::step: prepare or edit_rows was not called");
    typename State::Scratch& scratch = state.scratch;
    scratch.coefficients.assign(blocks.size(), {});
    scratch.chunks.clear();
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      scratch.coefficients[b].stepped =
          rates[b] != 0 && !(options.skip_anchor_blocks && blocks[b].kind == RowKind::anchor);
      if (!scratch.coefficients[b].stepped && !options.zero_gradients_after) continue;
      for (std::size_t begin = 0; begin < blocks[b].size(); begin += grain) {
        scratch.chunks.push_back(
            {b, blocks[b].offset + begin, blocks[b].offset + std::min(begin + grain, blocks[b].size())});
      }
    }
    AdamReport report;
    T* const g = arena.all_gradients().data();  // taken, as zeros, if no gradient was written yet
    find_coefficients(arena, blocks, rates, state, executor, report);

    T* const p = arena.all_values().data();
    T* const m = state.first_moment.data();
    T* const v = state.second_moment.data();
    executor.for_chunks(scratch.chunks.size(), 1, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i) {
        const typename State::Scratch::Chunk chunk = scratch.chunks[i];
        const typename State::Scratch::Coefficients c = scratch.coefficients[chunk.block];
        if (c.stepped && options.zero_gradients_after) {
          update<true>(c, chunk, p, g, m, v);
        } else if (c.stepped) {
          update<false>(c, chunk, p, g, m, v);
        } else if (options.zero_gradients_after) {
          std::fill(g + chunk.begin, g + chunk.end, T{});
        }
      }
    });
    return report;
  }

  static constexpr std::size_t grain = 16384;            ///< scalars: four streams of 64 KiB fit the second cache
  static constexpr std::size_t prefetch_distance = 512;  ///< scalars; measured: 8 % of a pass over 7.6 million

 private:
  /// The guard, then the step counts and coefficients of the blocks that pass it.
  template <Executor E>
  void find_coefficients(const ParameterArena<T>& arena, std::span<const ArenaLayout::Block> blocks,
                         std::span<const double> rates, State& state, E& executor, AdamReport& report) const {
    typename State::Scratch& scratch = state.scratch;
    scratch.finite.resize(scratch.chunks.size());
    const T* const g = arena.all_gradients().data();
    executor.for_chunks(scratch.chunks.size(), 1, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i) {
        const typename State::Scratch::Chunk chunk = scratch.chunks[i];
        scratch.finite[i] =
            !scratch.coefficients[chunk.block].stepped || squares_finite(g + chunk.begin, chunk.end - chunk.begin) ? 1
                                                                                                                   : 0;
      }
    });
    for (std::size_t i = 0; i < scratch.chunks.size(); ++i) {
      typename State::Scratch::Coefficients& c = scratch.coefficients[scratch.chunks[i].block];
      if (scratch.finite[i] != 0 || !c.stepped) continue;
      c.stepped = false;
      if (!report.first_skipped.valid()) report.first_skipped = {scratch.chunks[i].block};
      ++report.skipped_blocks;
    }
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      typename State::Scratch::Coefficients& c = scratch.coefficients[b];
      if (!c.stepped) continue;
      const std::uint64_t t = ++state.steps[b];
      c.step_size = static_cast<T>(rates[b] / detail::bias_correction(settings_.beta1, t));
      c.inverse_root = static_cast<T>(1 / std::sqrt(detail::bias_correction(settings_.beta2, t)));
      ++report.stepped_blocks;
    }
  }

  /// Sum of 0 * g^2: zero, or NaN if any square is not finite. No branch, no order.
  static bool squares_finite(const T* g, std::size_t count) {
    using P = Pack<T, W>;
    P sum[4] = {P(T{}), P(T{}), P(T{}), P(T{})};
    std::size_t i = 0;
    for (; i + 4 * W <= count; i += 4 * W) {
      for (std::size_t lane = 0; lane < 4; ++lane) {
        const P x = P::load(g + i + lane * W);
        sum[lane] = fma(x * x, P(T{}), sum[lane]);
      }
    }
    T rest{};
    for (; i < count; ++i) rest += g[i] * g[i] * T{};
    return reduce_add((sum[0] + sum[1]) + (sum[2] + sum[3])) + rest == T{};
  }

  template <bool zero_gradients>
  void update(const typename State::Scratch::Coefficients& c, const typename State::Scratch::Chunk& chunk, T* p, T* g,
              T* m, T* v) const {
    std::size_t i = chunk.begin;
    for (; i + W <= chunk.end; i += W) {
      const std::size_t ahead = i + prefetch_distance < chunk.end ? i + prefetch_distance : i;
      for (const T* stream :
           {static_cast<const T*>(p), static_cast<const T*>(g), static_cast<const T*>(m), static_cast<const T*>(v)}) {
        __builtin_prefetch(stream + ahead);
      }
      update_pack<W, zero_gradients>(c, p + i, g + i, m + i, v + i);
    }
    for (; i < chunk.end; ++i) update_pack<1, zero_gradients>(c, p + i, g + i, m + i, v + i);
  }

  /// Every sum is inside an explicit fma, so that no compiler may round it differently at another width.
  template <int Lanes, bool zero_gradients>
  COMPMARK_INLINE void update_pack(const typename State::Scratch::Coefficients& c, T* p, T* g, T* m, T* v) const {
    using P = Pack<T, Lanes>;
    const P tiny(2 * std::numeric_limits<T>::min());
    const P gradient = P::load(g);
    P first = P::load(m);
    P second = P::load(v);
    first = fma(P(static_cast<T>(1 - settings_.beta1)), gradient - first, first);
    second =
        fma(P(static_cast<T>(1 - settings_.beta2)) * gradient, gradient, P(static_cast<T>(settings_.beta2)) * second);
    first = keep(abs(first) >= P(detail::smallest_first_moment<T>(settings_)), first);
    second = keep(second >= tiny, second);
    const P denominator = fma(sqrt(second), P(c.inverse_root), P(static_cast<T>(settings_.epsilon)));
    fnma(P(c.step_size), first / denominator, P::load(p)).store(p);
    first.store(m);
    second.store(v);
    if constexpr (zero_gradients) P(T{}).store(g);
  }

  Settings settings_;
};

}  // namespace compmark
