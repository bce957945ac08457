// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Readings of a message in sampled views that nobody photographed (scene/between.hpp): a message needs no photograph. `read` adds its gradients to
// those of the photographed view of an iteration. `read_held` renders the unmarked model there too and holds the marked render to it
// (MarkNumbers::fidelity). Cost: a render, a reading and the backward pass; held, one render more.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "compmark/core/absent.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/pipeline/mark_phases.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/pipeline/view_costs.hpp"
#include "compmark/scene/between.hpp"

namespace compmark {

/// For recipes with a MessageDecoder.
template <Recipe R>
class DrawnReading {
 public:
  using Scalar = typename R::Scalar;
  using Context = typename Pipeline<R>::Context;
  /// Whether a mark of this recipe can be held to the unmarked model's renders.
  static constexpr bool can_be_held = present<typename R::MessageDecoder> && present<typename R::Embedder>;

  /// Past the neighbours: those who read stand outside of the triangles too, at the rim of a capture most of all (docs/watermark_experiments.md).
  static constexpr double reach = 1.7;

  /// The training view that iteration t reads near if no photograph says which: those with room around them more often, and by a `share` of the
  /// draw those that cost more. `views` are always the same.
  template <class Views>
  [[nodiscard]] std::size_t roomy_view(const Views& views, std::uint64_t seed, std::int64_t t,
                                       const ViewCosts& costs = {}, double share = 0) {
    if (share > 0) costs.factors(share, factor_);
    if (room_.empty()) room_ = ViewRoom([&](std::size_t i) { return views.camera(i); }, views.size());
    return room_.view(Random(seed, static_cast<std::uint64_t>(t), random_stage("between room")).uniform(0), factor_);
  }

  /// Reads the message near training view `view` in iteration t and adds the gradients to the model's. `photographed` is the context of the
  /// iteration's own view, of which the noise of quantization is taken.
  template <class Views, Executor E>
  ForwardReport read(const Pipeline<R>& pipeline, Model<R>& model, const Views& views, std::size_t view,
                     std::uint64_t seed, std::int64_t t, const MarkPhases& phases, const Context& photographed,
                     E& executor) {
    const ViewCamera<R> camera = sampled_camera(views, view, seed, t);
    set_phases(photographed);
    return read_at(pipeline, model, camera, view, phases.between_weight(t), 0, executor);
  }

  /// The same, held to the unmarked model's render of the view by the fidelity of `phases`.
  template <class Views, Executor E>
  ForwardReport read_held(const Pipeline<R>& pipeline, Model<R>& model, const Views& views, std::size_t view,
                          std::uint64_t seed, std::int64_t t, const MarkPhases& phases, const Context& photographed,
                          E& executor) requires(can_be_held) {
    const ViewCamera<R> camera = sampled_camera(views, view, seed, t);
    set_phases(photographed);
    context_.road.embeds = false;
    if constexpr (present<typename R::EntropyModel>) {
      // The marked render is not held to what rounding did to the unmarked model: steps that take some of it back are as good as steps that carry
      // the message.
      if (photographed.road.rate.phase.round) context_.road.rate.phase = {};
    }
    static_cast<void>(pipeline.forward(model, camera, view, context_, executor));
    host_storage_.resize(context_.image.size());
    std::copy_n(context_.image.data, context_.image.size(), host_storage_.data());
    context_.road.embeds = true;
    set_phases(photographed);
    return read_at(pipeline, model, camera, view, phases.between_weight(t), fidelity(views, camera, phases), executor);
  }

  [[nodiscard]] const MarkReport& report() const { return context_.marks.report; }  ///< of the last reading
  [[nodiscard]] ImageView<const Scalar> image() const { return context_.image; }    ///< what was read
  /// The unmarked model's render of the same view, after read_held.
  [[nodiscard]] ImageView<const Scalar> host() const {
    return {host_storage_.data(), 3, context_.image.height, context_.image.width};
  }

 private:
  template <class Views>
  [[nodiscard]] static ViewCamera<R> sampled_camera(const Views& views, std::size_t view, std::uint64_t seed,
                                                    std::int64_t t) {
    const Random random(seed, static_cast<std::uint64_t>(t), random_stage("between"));
    const auto camera_of = [&](std::size_t i) -> ViewCamera<R> { return views.camera(i); };
    return drawn_camera(camera_of, views.size(), view, random, reach);
  }
  template <class Views>
  [[nodiscard]] double fidelity(const Views& views, const ViewCamera<R>& camera, const MarkPhases& phases) {
    if (!phases.fidelity_falls()) return phases.fidelity();
    if (distance_.empty()) distance_ = PhotographDistance([&](std::size_t i) { return views.camera(i); }, views.size());
    return phases.fidelity(distance_.medians(camera));
  }
  /// The noise of the iteration. The rate was counted in the photographed view; without one it is no loss (docs/watermark_experiments.md).
  void set_phases([[maybe_unused]] const Context& photographed) {
    if constexpr (present<typename R::DistortionLayer>) context_.road.phase = photographed.road.phase;
    if constexpr (present<typename R::EntropyModel>) {
      context_.road.rate.phase = photographed.road.rate.phase;
      context_.road.rate.phase.counts = false;
    }
  }
  template <Executor E>
  ForwardReport read_at(const Pipeline<R>& pipeline, Model<R>& model, const ViewCamera<R>& camera, std::size_t view,
                        double weight, double held, E& executor) {
    const ForwardReport report = pipeline.forward(model, camera, view, context_, executor);
    pipeline.message_loss(weight, held, host(), context_, executor);
    pipeline.backward(model, camera, view, context_, executor);
    return report;
  }

  Context context_;  ///< its own, so that the photographed view's stays
  Buffer<Scalar> host_storage_;
  ViewRoom room_;
  std::vector<double> factor_;  ///< of the views' room, of the last draw
  [[no_unique_address]] std::conditional_t<can_be_held, PhotographDistance, detail::Nothing<PhotographDistance>>
      distance_;
};

}  // namespace compmark
