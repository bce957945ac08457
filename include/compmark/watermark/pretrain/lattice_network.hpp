// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The lattice decoder as a trainable network: its weights as blocks of an arena, a batch at a time. Training from
// scratch stalls before the network has learned what a bit is (docs/spec/watermark.md, 1.6). This start avoids it:
// random lattice directions of a given period and a whitened head read messages already, and training moves them to
// where distortions hurt least.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/pretrain/whitening.hpp"

namespace compmark {

/// Frequencies of length 1 / period in a random direction, uniform phases, no head yet (lattice_head). One period for
/// each octave of contrast, or each blur of colour; a `spread` above 0 scales the periods of a Fourier feature
/// together, by up to so many octaves.
template <class T>
[[nodiscard]] LatticeWeights<T> random_lattice(const LatticeSettings& settings, std::span<const double> period,
                                               std::uint64_t seed, double spread = 0) {
  COMPMARK_ASSERT(3 * period.size() == settings.dimensions(), "random_lattice: one period an octave, or a blur");
  LatticeWeights<T> weights(settings);
  const Random random(seed, 0, random_stage("mark/pretrain/lattice"));
  const std::size_t dimensions = settings.dimensions();
  std::vector<double> direction(dimensions);
  for (std::size_t k = 0; k < weights.phase.size(); ++k) {
    double square = 0;
    for (std::size_t j = 0; j < dimensions; ++j) {
      direction[j] = random.normal(k * dimensions + j);
      square += direction[j] * direction[j];
    }
    const double stretch = std::exp2(spread * (2 * random.uniform((std::uint64_t{1} << 41) + k) - 1));
    for (std::size_t j = 0; j < dimensions; ++j)
      weights.frequency[k * dimensions + j] =
          static_cast<T>(direction[j] / std::sqrt(square) / period[j / 3] / stretch);
    weights.phase[k] = static_cast<T>(random.uniform((std::uint64_t{1} << 40) + k));
  }
  return weights;
}

template <class T>
class LatticeNetwork {
 public:
  using Scalar = T;
  struct Context {
    std::vector<typename LatticeDecoder<T>::Context> samples;
    LatticeWeights<T> gradient;
  };

  /// Adds the weights of `decoder`, which has no limited regions, to the arena.
  LatticeNetwork(LatticeDecoder<T> decoder, ParameterArena<T>& arena) : decoder_(std::move(decoder)) {
    const LatticeSettings& s = decoder_.settings();
    COMPMARK_ASSERT(!s.limited(), "LatticeNetwork: weights train without a limit");
    const auto features = static_cast<std::size_t>(s.features), bits = static_cast<std::size_t>(s.bits);
    blocks_ = {arena.add("frequency", features, s.dimensions(), RowKind::fixed, BlockRole::training,
                         LearningSchedule::fixed()),
               arena.add("phase", features, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed()),
               arena.add("head", bits, features, RowKind::fixed, BlockRole::training, LearningSchedule::fixed()),
               arena.add("bias", bits, 1, RowKind::fixed, BlockRole::training, LearningSchedule::fixed())};
    store(arena);
  }

  [[nodiscard]] int bits() const { return decoder_.bits(); }
  [[nodiscard]] const LatticeDecoder<T>& decoder() const { return decoder_; }
  [[nodiscard]] LatticeDecoder<T>& decoder() { return decoder_; }
  /// Rates of the blocks for a base rate: lattice directions are tens of turns long, phases and head near one.
  [[nodiscard]] std::vector<double> rates(double rate) const { return {10 * rate, rate, rate, rate}; }

  /// Arena to decoder, and back.
  void load(const ParameterArena<T>& arena) { exchange(arena, decoder_.weights(), copy_in); }
  void store(ParameterArena<T>& arena) const {
    const LatticeWeights<T>& w = decoder_.weights();
    const std::vector<T>* parts[] = {&w.frequency, &w.phase, &w.head, &w.bias};
    for (std::size_t b = 0; b < 4; ++b)
      std::copy(parts[b]->begin(), parts[b]->end(), arena.values(blocks_[b]).flat().begin());
  }

  /// logits [images, bits].
  template <Executor E>
  void forward(const ParameterArena<T>& arena, std::span<const ImageView<const T>> images, std::span<T> logits,
               Context& context, E& executor) {
    load(arena);
    context.samples.resize(images.size());
    const auto bits = static_cast<std::size_t>(decoder_.bits());
    for (std::size_t i = 0; i < images.size(); ++i)
      decoder_.forward(images[i], logits.subspan(i * bits, bits), context.samples[i], executor);
  }

  /// Adds to the arena's gradients and to d_images.
  template <Executor E>
  void backward(ParameterArena<T>& arena, std::span<const T> d_logits, std::span<const ImageView<T>> d_images,
                Context& context, E& executor) {
    const auto bits = static_cast<std::size_t>(decoder_.bits());
    context.gradient = LatticeWeights<T>(decoder_.settings());
    for (std::size_t i = 0; i < d_images.size(); ++i) {
      const std::span<const T> d = d_logits.subspan(i * bits, bits);
      decoder_.add_weight_gradient(d, context.gradient, context.samples[i], executor);
      decoder_.backward(d, d_images[i], context.samples[i], executor);
    }
    const LatticeWeights<T>& g = context.gradient;
    const std::vector<T>* parts[] = {&g.frequency, &g.phase, &g.head, &g.bias};
    for (std::size_t b = 0; b < 4; ++b) {
      const std::span<T> target = arena.gradients(blocks_[b]).flat();
      for (std::size_t i = 0; i < target.size(); ++i) target[i] += (*parts[b])[i];
    }
  }

 private:
  static constexpr auto copy_in = [](std::span<const T> from, std::vector<T>& to) {
    std::copy(from.begin(), from.end(), to.begin());
  };
  template <class Copy>
  void exchange(const ParameterArena<T>& arena, LatticeWeights<T>& w, const Copy& copy) const {
    std::vector<T>* parts[] = {&w.frequency, &w.phase, &w.head, &w.bias};
    for (std::size_t b = 0; b < 4; ++b) copy(arena.values(blocks_[b]).flat(), *parts[b]);
  }

  LatticeDecoder<T> decoder_;
  std::vector<BlockHandle> blocks_;
};

/// Features of unmarked images [count, features] -> a head of random orthonormal directions of the whitened features.
template <class T>
void lattice_head(LatticeDecoder<T>& decoder, std::span<const double> features, std::uint64_t seed) {
  const auto size = static_cast<std::size_t>(decoder.settings().features);
  const TriangularWhitening whitening = triangular_whitening(features, size, 0.1);
  const Random random(seed, 0, random_stage("mark/pretrain/carriers"));
  const std::vector<double> rows = orthonormal_rows(static_cast<std::size_t>(decoder.bits()), size, random);
  whitened_head(rows, whitening, std::span<T>(decoder.weights().head), std::span<T>(decoder.weights().bias));
}

}  // namespace compmark
