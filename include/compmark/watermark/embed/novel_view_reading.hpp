// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Readings of a message in sampled novel views (scene/novel_view.hpp): a message needs no photograph. `read` adds its
// gradients to those of the photographed view of an iteration. `read_held` also renders the unmarked model there and
// adds the loss of the difference (PosthocSettings::fidelity); `read_photographed` reads at a training view and adds
// the difference to its photograph. Cost: a render, a reading and the backward pass; for `read_held` one render more.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "compmark/core/absent.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/novel_view.hpp"
#include "compmark/scene/orbit_view.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/mark_phases.hpp"
#include "compmark/watermark/embed/view_costs.hpp"
#include "compmark/watermark/loss/message.hpp"

namespace compmark {

template <Recipe R>
struct Model;
template <Recipe R>
class Pipeline;
template <Recipe R>
class TrainingTarget;
struct ForwardReport;
template <class Decoder>
class MessageStage;

/// The reading of a message.
struct ReadingReport {
  double message = 0;    ///< mean loss of a bit, cross entropy or hinge
  std::size_t bits = 0;  ///< 0: the message was not read
  std::size_t matches = 0;
  double distortion = 0;  ///< mean square difference from the unmarked render, where it was measured
  double total = 0;       ///< weighted sum
};

namespace detail {
/// fidelity * mean w (image - target)^2: its gradient into d_image (set), the mean returned; zeros at a fidelity of 0.
/// `weight` has a number for each pixel of a plane, or is empty: 1.
template <class Scalar, Executor E>
double square_distortion(ImageView<const Scalar> image, ImageView<const Scalar> target, Scalar fidelity,
                         ImageView<Scalar> d_image, Buffer<double>& sums, E& executor,
                         std::span<const Scalar> weight = {}) {
  constexpr std::size_t grain = 1 << 14;
  sums.resize(chunk_count(image.size(), grain));
  if (!(fidelity > Scalar(0))) {
    executor.for_chunks(image.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::fill(d_image.data + begin, d_image.data + end, Scalar(0));
    });
    return 0;
  }
  COMPMARK_ASSERT(target.size() == image.size(), "message_loss: the image to be held to is of another size");
  const Scalar slope = Scalar(2) * fidelity / static_cast<Scalar>(image.size());
  const auto measure = [&](const auto& counts) {
    executor.for_chunks(image.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      double sum = 0;
      for (std::size_t i = begin; i < end; ++i) {
        const Scalar difference = image.data[i] - target.data[i], counted = counts(i) * difference;
        d_image.data[i] = slope * counted;
        sum += static_cast<double>(counted) * static_cast<double>(difference);
      }
      sums[begin / grain] = sum;
    });
  };
  if (weight.empty()) {
    measure([](std::size_t) { return Scalar(1); });
  } else {
    measure([&](std::size_t i) { return weight[i % weight.size()]; });
  }
  double sum = 0;
  for (const double of_chunk : sums) sum += of_chunk;
  return sum / static_cast<double>(image.size());
}
}  // namespace detail

/// The loss of a render without a photograph, in place of Pipeline::loss. context.d_image is set from the message loss,
/// by the weight of the forward pass. With a weight `fidelity` above 0 the mean square difference to `target`, the
/// unmarked render or the photograph of the same view, is added; pixels count by `counts`, if it is not empty.
template <Recipe R, Executor E>
ReadingReport message_loss(const Pipeline<R>& pipeline, double fidelity, ImageView<const typename R::Scalar> target,
                           typename Pipeline<R>::Context& context, E& executor,
                           std::span<const typename R::Scalar> counts = {}) {
  using Scalar = typename R::Scalar;
  pipeline.begin_loss(context);
  ReadingReport report;
  report.distortion =
      detail::square_distortion<Scalar>(context.image, target, static_cast<Scalar>(fidelity), context.d_image,
                                        context.template of<MessageStage>().distortion, executor, counts);
  const auto& phase = context.phases.template of<MessageStage>();
  const double weight = phase.weight;
  const MessageReport read = pipeline.template stage<MessageStage>().pull(
      context.image, context.d_image, phase, context.template of<MessageStage>(), executor);
  report.message = read.loss;
  report.bits = read.bits;
  report.matches = read.matches;
  report.total = weight * read.loss + fidelity * report.distortion;
  return report;
}

/// For recipes with a MessageDecoder.
template <Recipe R>
class NovelViewReading {
 public:
  using Scalar = typename R::Scalar;
  using Context = typename Pipeline<R>::Context;
  using Phases = typename Pipeline<R>::Phases;
  /// Whether post-hoc embedding can compare marked and unmarked renders of this recipe.
  static constexpr bool can_be_held = present<typename R::MessageDecoder> && present<typename R::Embedder>;

  /// Beyond the neighbours: readers stand outside of the triangles too, at the rim of a capture most of all
  /// (docs/notebook/watermark_experiments.md).
  static constexpr double reach = 1.7;

  /// The training view that iteration t reads near if no photograph determines it. Views with much clearance are drawn
  /// more often; a `share` of the draw goes by the message loss instead. `views` are the same in every call.
  template <class Views>
  [[nodiscard]] std::size_t view_by_clearance(const Views& views, std::uint64_t seed, std::int64_t t,
                                              const ViewCosts& costs = {}, double share = 0) {
    if (share > 0) costs.factors(share, factor_);
    if (clearance_.empty()) clearance_ = ViewClearance([&](std::size_t i) { return views.camera(i); }, views.size());
    return clearance_.view(Random(seed, static_cast<std::uint64_t>(t), random_stage("between room")).uniform(0),
                           factor_);
  }

  /// Reads the message near training view `view` in iteration t and adds the gradients to the model's. The stages are
  /// in the phases of the iteration, but for what belongs to its photograph. Where the report that is returned has an
  /// error (raster), nothing was read and no gradient added.
  template <class Views, Executor E>
  auto read(const Pipeline<R>& pipeline, Model<R>& model, const Views& views, std::size_t view, std::uint64_t seed,
            std::int64_t t, const MarkPhases& schedule, const Phases& phases, E& executor) {
    const ViewCamera<R> camera = sampled_camera(views, view, seed, t, schedule);
    return read_at(pipeline, model, camera, view, without_photograph(phases), schedule.novel_view_weight(t), 0, {}, {},
                   executor);
  }

  /// The same, with the loss of the difference to the unmarked render by the fidelity of `schedule`. An error may be
  /// that of the unmarked render.
  template <class Views, Executor E>
  auto read_held(const Pipeline<R>& pipeline, Model<R>& model, const Views& views, std::size_t view, std::uint64_t seed,
                 std::int64_t t, const MarkPhases& schedule, const Phases& phases, E& executor) requires(can_be_held) {
    const ViewCamera<R> camera = sampled_camera(views, view, seed, t, schedule);
    const Phases marked = without_photograph(phases);
    Phases unmarked = marked;
    Pipeline<R>::Stages::forward([&]<class S>() { S::leave_mark(unmarked.template of<S>()); });
    report_ = {};
    const auto plain = pipeline.forward(model, camera, view, context_, executor, unmarked);
    if (plain.raster.error) return plain;
    unmarked_storage_.resize(context_.image.size());
    std::copy_n(context_.image.data, context_.image.size(), unmarked_storage_.data());
    return read_at(pipeline, model, camera, view, marked, schedule.novel_view_weight(t),
                   fidelity(views, camera, schedule), this->unmarked(), {}, executor);
  }

  /// The same at training view `view` itself, with the loss of the difference to its photograph, which `target` is
  /// filled with. An Error of the views (no photograph) leaves nothing read.
  template <class Views, Executor E>
  auto read_photographed(const Pipeline<R>& pipeline, Model<R>& model, Views& views, std::size_t view, std::int64_t t,
                         const MarkPhases& schedule, const Phases& phases, TrainingTarget<R>& target,
                         E& executor) requires(can_be_held) {
    const ViewCamera<R> camera = views.camera(view);
    const Phases marked = without_photograph(phases);
    const auto read = [&] {
      return read_at(pipeline, model, camera, view, marked, schedule.novel_view_weight(t),
                     fidelity(views, camera, schedule), target.image(), target.weight(), executor);
    };
    using Report = Result<decltype(read())>;
    report_ = {};
    const auto behind = Pipeline<R>::background(model.render, marked);
    if (Result<Done> loaded = target.load(views, view, camera, behind); !loaded) return Report(loaded.error());
    return Report(read());
  }

  [[nodiscard]] const ReadingReport& report() const { return report_; }           ///< of the last reading
  [[nodiscard]] ImageView<const Scalar> image() const { return context_.image; }  ///< the image that was read
  /// The unmarked model's render of the same view, after read_held.
  [[nodiscard]] ImageView<const Scalar> unmarked() const {
    return {unmarked_storage_.data(), 3, context_.image.height, context_.image.width};
  }

 private:
  template <class Views>
  [[nodiscard]] static ViewCamera<R> sampled_camera(const Views& views, std::size_t view, std::uint64_t seed,
                                                    std::int64_t t, const MarkPhases& schedule) {
    const Random random(seed, static_cast<std::uint64_t>(t), random_stage("between"));
    const auto camera_of = [&](std::size_t i) -> ViewCamera<R> { return views.camera(i); };
    if (schedule.orbit_share() > 0 && random.uniform(6) < schedule.orbit_share())
      return orbit_view_camera(camera_of, views.size(), view, random);
    return novel_view_camera(camera_of, views.size(), view, random, reach);
  }
  template <class Views>
  [[nodiscard]] double fidelity(const Views& views, const ViewCamera<R>& camera, const MarkPhases& schedule) {
    if (!schedule.fidelity_falls()) return schedule.fidelity();
    if (distance_.empty()) distance_ = PhotographDistance([&](std::size_t i) { return views.camera(i); }, views.size());
    return schedule.fidelity(distance_.medians(camera));
  }
  [[nodiscard]] static Phases without_photograph(Phases phases) {
    Pipeline<R>::Stages::forward([&]<class S>() { S::leave_photograph(phases.template of<S>()); });
    return phases;
  }
  template <Executor E>
  auto read_at(const Pipeline<R>& pipeline, Model<R>& model, const ViewCamera<R>& camera, std::size_t view,
               Phases phases, double weight, double held, ImageView<const Scalar> target,
               std::span<const Scalar> counts, E& executor) {
    phases.template of<MessageStage>().weight = weight;
    const auto report = pipeline.forward(model, camera, view, context_, executor, phases);
    report_ = {};
    if (report.raster.error) return report;
    report_ = message_loss(pipeline, held, target, context_, executor, counts);
    pipeline.backward(model, camera, view, context_, executor);
    return report;
  }

  Context context_;  ///< its own: that of the photographed view is still needed
  ReadingReport report_;
  Buffer<Scalar> unmarked_storage_;
  ViewClearance clearance_;
  std::vector<double> factor_;  ///< of the views' clearances, of the last draw
  [[no_unique_address]] std::conditional_t<can_be_held, PhotographDistance, detail::Nothing<PhotographDistance>>
      distance_;
};

}  // namespace compmark
