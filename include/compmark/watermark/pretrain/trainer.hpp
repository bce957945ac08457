// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Trains a message decoder without an encoder. An encoder is a means to get marked images; in a scene the message is
// put in by gradient steps through the decoder, so the training pairs come from the same steps: every slot of a batch
// holds a crop of a photograph, a random message and a change of bounded PSNR, and each iteration distorts all slots,
// reads them, and uses the one backward pass twice, for a step of the weights and for a step of every slot's pixels.
// After `life` steps a slot starts again with another crop and another message, so that nothing but the message can be
// learned. Young slots carry little yet and count less in the weights' loss. Curriculum: the PSNR rises from
// `first_psnr`, and the distortions come in one after the other. Every number is a function of (seed, iteration) and of
// the state, so a resumed run ends in the same bits. Cost: one forward and backward pass of the network a slot.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"
#include "compmark/watermark/pretrain/pixel_adam.hpp"
#include "compmark/watermark/pretrain/pixel_embedding.hpp"

namespace compmark {

struct PretrainSettings {
  std::int64_t steps = 4000;
  std::size_t batch = 8;
  int side = 128;      ///< of the crops
  int life = 24;       ///< steps of a slot
  double rate = 1e-3;  ///< of the weights: after a warm-up of 1 % it falls along a cosine to rate / 50
  double pixel_rate = 0.004;
  double first_psnr = 34;       ///< and psnr from `strength_until` on
  double psnr = 37;             ///< small crops are read at a little more strength than whole images are marked with
  double strength_until = 0.5;  ///< share of the steps
  double distortions_from = 0.02, distortions_until = 0.3;  ///< shares between which they come in
  double temperature = 1.5;
  AugmentationSettings augmentation;
  std::uint64_t seed = 1;
};

/// cos from `rate` to rate / 50, with a linear start.
[[nodiscard]] inline double pretrain_rate(const PretrainSettings& s, std::int64_t iteration) {
  const double at = static_cast<double>(iteration) / static_cast<double>(s.steps);
  const double low = s.rate / 50;
  const double cosine = low + (s.rate - low) * 0.5 * (1 + std::cos(std::numbers::pi * std::min(at, 1.0)));
  return cosine * std::min(1.0, (at + 1 / static_cast<double>(s.steps)) / 0.01);
}
[[nodiscard]] inline double pretrain_psnr(const PretrainSettings& s, std::int64_t iteration) {
  const double at = static_cast<double>(iteration) / static_cast<double>(s.steps);
  return s.first_psnr + (s.psnr - s.first_psnr) * std::min(1.0, at / s.strength_until);
}
/// The settings with the distortions that have come in by now, in the order of the enumeration; `none` counts from the
/// start.
[[nodiscard]] inline AugmentationSettings pretrain_augmentation(const PretrainSettings& s, std::int64_t iteration) {
  AugmentationSettings now = s.augmentation;
  const double at = static_cast<double>(iteration) / static_cast<double>(s.steps);
  const double span = std::max(1e-9, s.distortions_until - s.distortions_from);
  for (std::size_t kind = 1; kind < augmentation_count; ++kind) {
    const double begin = s.distortions_from + span * static_cast<double>(kind - 1) / (augmentation_count - 1);
    if (at < begin) now.weight[kind] = 0;
  }
  if (now.weight[0] <= 0 && at < s.distortions_until) now.weight[0] = 1;
  return now;
}

/// One marked crop on its way.
template <class T>
struct PretrainSlot {
  Buffer<T> original;
  std::vector<T> signs;
  PixelChange<T> pixels;
  int age = 0;
  int life = 0;
};

/// All that a checkpoint holds besides the arena and the optimizer's state.
template <class T>
struct PretrainState {
  std::int64_t iteration = 0;
  std::vector<PretrainSlot<T>> slots;
};

/// The report of one iteration; accuracies are of the slots in their last third of life, under the distortion they were
/// read through.
struct PretrainReport {
  double loss = 0;
  double psnr = 0;
  std::array<double, augmentation_count> correct{};
  std::array<double, augmentation_count> read{};
};

/// Photographs: size(), and read(index, random, side, view), which fills a square RGB crop in [0, 1] chosen by the
/// stream.
template <class Network>
class Pretrainer {
 public:
  using T = typename Network::Scalar;
  using State = PretrainState<T>;

  struct Context {
    std::vector<Augmenter<T>> augmenters;
    std::vector<AugmentationDraw> draws;
    std::vector<Buffer<T>> marked, d_marked, d_seen;
    std::vector<ImageView<const T>> seen;
    std::vector<ImageView<T>> d_views;
    std::vector<T> logits, d_logits;
    typename Network::Context network;
  };

  explicit Pretrainer(const PretrainSettings& settings) : settings_(settings) {}
  [[nodiscard]] const PretrainSettings& settings() const { return settings_; }

  /// Fresh slots of staggered ages.
  template <class Photographs>
  void prepare(const Photographs& photographs, int bits, State& state) const {
    state.iteration = 0;
    state.slots.resize(settings_.batch);
    for (std::size_t i = 0; i < state.slots.size(); ++i) {
      spawn(photographs, bits, i, 0, state.slots[i]);
      state.slots[i].life = 1 + static_cast<int>(i) * settings_.life / static_cast<int>(state.slots.size());
    }
  }

  /// One iteration: gradients, the weights' step, the pixels' step.
  template <class Photographs, class Optimizer, class OptimizerState, Executor E, class Jpeg>
  PretrainReport step(const Photographs& photographs, Network& network, ParameterArena<T>& arena,
                      const Optimizer& optimizer, OptimizerState& optimizer_state, State& state, Context& context,
                      const Jpeg& jpeg, E& executor) const {
    const auto bits = static_cast<std::size_t>(network.bits());
    const std::size_t batch = state.slots.size();
    const int side = settings_.side;
    const double psnr = pretrain_psnr(settings_, state.iteration);
    read_slots(photographs, network.bits(), state, context, jpeg, executor);
    context.logits.resize(batch * bits);
    network.forward(arena, context.seen, context.logits, context.network, executor);
    PretrainReport report = slopes(state, bits, context);
    report.psnr = psnr;
    context.d_views.clear();
    for (std::size_t i = 0; i < batch; ++i) {
      context.d_seen[i].resize(context.seen[i].size(), T(0));
      context.d_views.push_back({context.d_seen[i].data(), 3, context.seen[i].height, context.seen[i].width});
    }
    network.backward(arena, context.d_logits, context.d_views, context.network, executor);
    const std::vector<double> rates = network.rates(pretrain_rate(settings_, state.iteration));
    optimizer.step(arena, rates, optimizer_state, executor);
    for (T& g : arena.all_gradients()) g = T(0);
    for (std::size_t i = 0; i < batch; ++i) {
      PretrainSlot<T>& slot = state.slots[i];
      context.d_marked[i].resize(slot.original.size(), T(0));
      const ImageView<T> d_marked{context.d_marked[i].data(), 3, side, side};
      context.augmenters[i].backward(context.d_views[i], d_marked, executor);
      const double left = 1 - static_cast<double>(slot.age) / slot.life;
      slot.pixels.step({slot.original.data(), 3, side, side}, d_marked,
                       settings_.pixel_rate * std::min(1.0, 2 * left + 0.05), psnr);
      ++slot.age;
    }
    ++state.iteration;
    return report;
  }

 private:
  template <class Photographs>
  void spawn(const Photographs& photographs, int bits, std::size_t index, std::int64_t iteration,
             PretrainSlot<T>& slot) const {
    const Random random(settings_.seed, static_cast<std::uint64_t>(iteration) * settings_.batch + index,
                        random_stage("mark/pretrain/spawn"));
    const auto side = static_cast<std::size_t>(settings_.side);
    slot.original.resize(3 * side * side);
    photographs.read(static_cast<std::size_t>(random.below(0, photographs.size())), random, settings_.side,
                     ImageView<T>{slot.original.data(), 3, settings_.side, settings_.side});
    slot.signs.resize(static_cast<std::size_t>(bits));
    for (std::size_t b = 0; b < slot.signs.size(); ++b)
      slot.signs[b] = (random.bits(1000 + b) & 1u) != 0 ? T(1) : T(-1);
    slot.pixels.reset(slot.original.size());
    slot.age = 0;
    slot.life = settings_.life;
  }

  template <class Photographs, class Jpeg, class E>
  void read_slots(const Photographs& photographs, int bits, State& state, Context& context, const Jpeg& jpeg,
                  E& executor) const {
    const std::size_t batch = state.slots.size();
    context.augmenters.resize(batch);
    context.draws.resize(batch);
    context.marked.resize(batch);
    context.d_marked.resize(batch);
    context.d_seen.resize(batch);
    context.seen.resize(batch);
    const AugmentationSettings augmentation = pretrain_augmentation(settings_, state.iteration);
    for (std::size_t i = 0; i < batch; ++i) {
      PretrainSlot<T>& slot = state.slots[i];
      if (slot.age >= slot.life) spawn(photographs, bits, i, state.iteration, slot);
      context.marked[i].resize(slot.original.size());
      const ImageView<T> marked{context.marked[i].data(), 3, settings_.side, settings_.side};
      slot.pixels.write({slot.original.data(), 3, settings_.side, settings_.side}, marked);
      const Random random(settings_.seed, static_cast<std::uint64_t>(state.iteration) * batch + i,
                          random_stage("mark/pretrain/distort"));
      context.draws[i] = draw_augmentation(augmentation, random);
      context.seen[i] = context.augmenters[i].forward(marked, context.draws[i], jpeg, executor);
    }
  }

  /// d_logits, weighted by age, and the report.
  [[nodiscard]] PretrainReport slopes(const State& state, std::size_t bits, Context& context) const {
    PretrainReport report;
    const std::size_t batch = state.slots.size();
    context.d_logits.resize(batch * bits);
    double weights = 0;
    for (std::size_t i = 0; i < batch; ++i) {
      const PretrainSlot<T>& slot = state.slots[i];
      const double weight = (slot.age + 1.0) / slot.life;
      const bool ripe = 3 * slot.age >= 2 * slot.life;
      const auto kind = static_cast<std::size_t>(context.draws[i].kind);
      weights += weight;
      double loss = 0;
      for (std::size_t b = 0; b < bits; ++b) {
        const T logit = context.logits[i * bits + b], sign = slot.signs[b];
        const double x = settings_.temperature * static_cast<double>(sign * logit);
        loss += (std::log1p(std::exp(-std::abs(x))) + std::max(-x, 0.0)) / static_cast<double>(bits);
        context.d_logits[i * bits + b] = static_cast<T>(weight / static_cast<double>(batch * bits)) *
                                         signed_logit_slope(logit, sign, static_cast<T>(settings_.temperature));
        if (ripe) report.correct[kind] += sign * logit > T(0) ? 1 : 0;
        if (ripe) report.read[kind] += 1;
      }
      report.loss += weight * loss;
    }
    report.loss /= weights;
    return report;
  }

  PretrainSettings settings_;
};

}  // namespace compmark
