// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One archetype per concept: it has what the concept requires and nothing more, and does as little as the laws allow.
// They prove that a concept asks for no more than it says (an archetype that grows shows a concept that grew), and are
// the shortest policies to copy.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/decoder_shape.hpp"
#include "compmark/splat/anchor/density_control.hpp"
#include "compmark/splat/loss/concept.hpp"
#include "compmark/splat/optim/concept.hpp"
#include "compmark/splat/raster/concept.hpp"

namespace compmark {
namespace testing {

/// Executor: one worker, the calling thread.
struct ExecutorArchetype {
  [[nodiscard]] std::size_t concurrency() const { return 1; }
  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    for (std::size_t begin = 0; begin < n; begin += grain)
      body(begin, begin + grain < n ? begin + grain : n, std::size_t{0});
  }
};

/// Rasterizer: sees nothing; the image is the background and every gradient is zero.
template <class T>
struct RasterizerArchetype {
  using Scalar = T;
  struct Settings {
    T near_plane = T(0.2);
    T blur_variance = T(0.3);
  };
  struct Context {};

  RasterizerArchetype() = default;
  explicit RasterizerArchetype(const Settings& /*settings*/) {}

  template <Executor E>
  RasterReport forward(GaussianColumns<const T> /*gaussians*/, const Camera<T>& /*camera*/, std::array<T, 3> background,
                       ImageView<T> image, Context& /*ctx*/, E& /*executor*/) const {
    for (int c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < image.plane_size(); ++i) image.plane(c)[i] = background[static_cast<std::size_t>(c)];
    }
    return {};
  }
  template <Executor E>
  void backward(GaussianColumns<const T> /*gaussians*/, const Camera<T>& /*camera*/, std::array<T, 3> /*background*/,
                ImageView<const T> /*d_image*/, GaussianColumns<T> /*d_gaussians*/, Context& /*ctx*/,
                E& /*executor*/) const {}
  [[nodiscard]] ScreenStatistics<T> screen(const Context& /*ctx*/) const { return {}; }
};

/// ImageLoss: zero everywhere.
template <class T>
struct ImageLossArchetype {
  using Scalar = T;
  struct Settings {};
  struct Context {};
  struct Report {
    double loss = 0;
  };
  template <Executor E>
  Report forward(ImageView<const T> /*rendered*/, ImageView<const T> /*target*/, Context& /*ctx*/,
                 E& /*executor*/) const {
    return {};
  }
  template <Executor E>
  Report forward_backward(ImageView<const T> /*rendered*/, ImageView<const T> /*target*/, T /*weight*/,
                          ImageView<T> /*d_rendered*/, Context& /*ctx*/, E& /*executor*/) const {
    return {};
  }
};

/// Optimizer: never moves.
template <class T>
struct OptimizerArchetype {
  using Scalar = T;
  struct Settings {};
  struct State {};
  void prepare(const ArenaLayout& /*layout*/, State& /*state*/) const {}
  template <Executor E>
  OptimizerReport step(ParameterArena<T>& /*arena*/, std::span<const double> /*rates*/, State& /*state*/,
                       E& /*executor*/, StepOptions /*options*/ = {}) const {
    return {};
  }
  void edit_rows(const RowEdit& /*edit*/, const ArenaLayout& /*old_layout*/, const ArenaLayout& /*new_layout*/,
                 State& /*state*/) const {}
};

/// DensityControl: no anchor is born and none dies.
template <class T>
struct DensityControlArchetype {
  using Scalar = T;
  struct Settings {};
  struct State {};

  DensityControlArchetype() = default;
  explicit DensityControlArchetype(const Settings& /*settings*/) {}

  void prepare(std::size_t /*anchors*/, State& /*state*/) const {}
  template <Executor E>
  void observe(const DecodedStatistics<T>& /*decoded*/, std::span<const std::uint8_t> /*gaussian_visible*/,
               std::span<const T> /*gradient_norm*/, State& /*state*/, E& /*executor*/) const {}
  template <class OnEdit>
  GrowthReport adapt(ParameterArena<T>& /*arena*/, const AnchorHandles& /*handles*/, State& /*state*/,
                     const AdjustmentInputs& /*inputs*/, OnEdit&& /*on_edit*/) const {
    return {};
  }
};

/// GaussianDecoder: every anchor is one grey Gaussian, where it stands; nothing trains but positions.
template <class T, DecoderShape decoder_shape>
struct GaussianDecoderArchetype {
  using Scalar = T;
  static constexpr DecoderShape shape = decoder_shape;
  struct Handles {};
  struct Context {
    std::span<const std::uint32_t> visible;
    Buffer<T> opacity_sum;
    Buffer<std::uint32_t> slot;
  };
  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& /*arena*/, std::size_t /*views*/) { return {}; }
  static void initialise(ParameterArena<T>& /*arena*/, const Handles& /*blocks*/, std::uint64_t /*seed*/) {}
  template <Executor E>
  std::size_t forward(const AnchorColumns<const T>& anchors, std::span<const std::uint32_t> visible,
                      const std::array<double, 3>& /*center*/, std::size_t /*view*/, const ParameterArena<T>& /*arena*/,
                      const Handles& /*blocks*/, GaussianBatch<T>& batch, Context& ctx, E& /*executor*/) const {
    ctx.visible = visible;
    batch.resize(visible.size());
    ctx.opacity_sum.resize(visible.size());
    ctx.slot.resize(visible.size());
    const GaussianColumns<T> out = batch.columns();
    for (std::size_t i = 0; i < visible.size(); ++i) {
      for (std::size_t a = 0; a < 3; ++a) {
        out.mean[a][i] = anchors.position(visible[i], a);
        out.scale[a][i] = T(0.05);
        out.color[a][i] = T(0.5);
        out.rotation[a + 1][i] = T(0);
      }
      out.rotation[0][i] = T(1);
      out.opacity[i] = ctx.opacity_sum[i] = T(0.5);
      ctx.slot[i] = visible[i] * static_cast<std::uint32_t>(shape.offsets);
    }
    return visible.size();
  }
  template <Executor E>
  void backward(const AnchorColumns<const T>& /*anchors*/, std::span<const std::uint32_t> visible,
                const std::array<double, 3>& /*center*/, std::size_t /*view*/, ParameterArena<T>& /*arena*/,
                const Handles& /*blocks*/, const GaussianColumns<const T>& d_gaussians,
                const AnchorColumns<T>& d_anchors, Context& /*ctx*/, E& /*executor*/) const {
    for (std::size_t i = 0; i < visible.size(); ++i) {
      for (std::size_t a = 0; a < 3; ++a) d_anchors.position(visible[i], a) += d_gaussians.mean[a][i];
    }
  }
  [[nodiscard]] DecodedStatistics<T> statistics(const Context& ctx) const {
    return {ctx.visible, {ctx.opacity_sum.data(), ctx.visible.size()}, {ctx.slot.data(), ctx.visible.size()}};
  }
};

/// MessageDecoder: one bit, the mean of the image against one half.
template <class T>
struct MessageDecoderArchetype {
  using Scalar = T;
  struct Context {};
  [[nodiscard]] static constexpr int bits() { return 1; }
  [[nodiscard]] static constexpr int minimum_size() { return 1; }
  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context& /*ctx*/, E& /*executor*/) const {
    T sum = 0;
    for (const T value : image.flat()) sum += value;
    logits[0] = sum / static_cast<T>(image.size()) - T(0.5);
  }
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& /*ctx*/, E& /*executor*/) const {
    for (T& value : d_image.flat()) value += d_logits[0] / static_cast<T>(d_image.size());
  }
};

}  // namespace testing
}  // namespace compmark
