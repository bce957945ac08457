// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The scale volume loss in the lengths of a space. In the world it is splat/loss/scale_volume.hpp and nothing else.
// Where cells are stretched, each Gaussian counts with its volume in cells, s0 s1 s2 / stretch^3: at 100 radii from the
// cameras a Gaussian that looks as large as a near one has about 125,000 times its volume, and the published mean of
// volumes of the world, which such Gaussians rule, takes them all (tests/splat/training/far_field.test.cpp). The
// stretch is that at the Gaussian's anchor: anchors stand still, so that it is a constant and the gradient is exact;
// the loss shrinks Gaussians and never pushes them outwards, to where they would count less. Cost beyond the world's: a
// square root and two divisions a visible anchor, 4 bytes of scratch an anchor and 4 a Gaussian.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "compmark/core/absent.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/space.hpp"
#include "compmark/splat/loss/scale_volume.hpp"

namespace compmark {

/// `Offsets` is the number of Gaussians that an anchor may have.
template <class T, Space S, int Offsets>
class SpaceVolumeLoss {
  using World = ScaleVolumeLoss<T>;
  struct Stretched {
    typename World::Context world;
    MatrixView<const T> position;      ///< of the anchors
    DecodedStatistics<T> decoded;      ///< which of them were decoded, and into which Gaussians
    Buffer<T> of_anchor, of_gaussian;  ///< 1 / stretch^3; of the visible anchors alone
  };

 public:
  using Context = std::conditional_t<present<S>, Stretched, typename World::Context>;

  SpaceVolumeLoss() = default;
  explicit SpaceVolumeLoss(const S& space) : space_(space) {}

  /// Keeps the anchors of a forward pass, where the space stretches: their positions, and statistics() of the decoded
  /// ones.
  template <class Statistics>
  static void look([[maybe_unused]] Context& context, [[maybe_unused]] MatrixView<const T> position,
                   [[maybe_unused]] Statistics&& statistics) {
    if constexpr (present<S>) {
      context.position = position;
      context.decoded = statistics();
    }
  }

  template <Executor E>
  ScaleVolumeReport forward(const std::array<const T*, 3>& scale, std::size_t count, Context& context,
                            E& executor) const {
    if constexpr (present<S>) {
      context.of_anchor.resize(context.position.rows);
      context.of_gaussian.resize(count);
      const auto& visible = context.decoded.visible;
      executor.for_chunks(visible.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t n = begin; n < end; ++n) {
          const double stretch = space_.stretch(context.position.row(visible[n]));
          context.of_anchor[visible[n]] = static_cast<T>(1 / (stretch * stretch * stretch));
        }
      });
      executor.for_chunks(count, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i)
          context.of_gaussian[i] = context.of_anchor[context.decoded.gaussian_slot[i] / static_cast<unsigned>(Offsets)];
      });
      return World{}.forward(scale, context.of_gaussian.data(), count, context.world, executor);
    } else {
      return World{}.forward(scale, count, context, executor);
    }
  }
  /// ADDS weight dloss/dscale into `d_scale`, after forward of the same Gaussians.
  template <Executor E>
  void backward(const std::array<const T*, 3>& scale, std::size_t count, T weight, const std::array<T*, 3>& d_scale,
                Context& context, E& executor) const {
    if constexpr (present<S>) {
      World{}.forward_backward(scale, context.of_gaussian.data(), count, weight, d_scale, context.world, executor);
    } else {
      World{}.forward_backward(scale, count, weight, d_scale, context, executor);
    }
  }

 private:
  static constexpr std::size_t grain = 8192;

  [[no_unique_address]] S space_;
};

}  // namespace compmark
