// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Quantization distortion layer (docs/spec/method.md, 5.2): while training, the anchors' attributes carry the noise
// that rounding will add later,
//   f~ = f + q u,  u ~ U(-1/2, 1/2),  q = Q0 (1 + tanh MLP_q(f)),   exp(s)~ = exp(s) + a_s u,   o~ = o + a_o u,
// or, in an iteration of hard rounding, the rounding itself: u = round(f / q) - f / q, with gradients straight through.
// One q a channel (the published code) or an anchor (the paper). Nothing in the published losses rewards a large q, so
// it collapses (docs/spec/numerics.md, QD2); three measures, each off by itself: a least step, a rate term -w log2(q /
// Q0), as the published profiles have it, and q without gradient. Random numbers: of (seed, iteration, row, channel).
// An anchor: 4 D^2 flop forward, 12 D^2 backward; 2 ns a random number. Longer than 300 lines: one layout of panels.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/dense.hpp"
#include "compmark/splat/quantizer/adaptive_quantizer.hpp"
#include "compmark/splat/quantizer/concept.hpp"

namespace compmark {

/// Choices the compiler needs.
struct DistortionOptions {
  bool per_channel = true;  ///< else one step an anchor
  bool detach = false;      ///< no gradient through q

  friend bool operator==(const DistortionOptions&, const DistortionOptions&) = default;
};

template <class T, int feature_dim, DistortionOptions options = DistortionOptions{},
          class Quantizer = AdaptiveQuantizer<T>>
class QuantizationNoise {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  /// The same layer with the steps and the rounding of another quantizer: a recipe's layer has the recipe's.
  template <class Other>
  using WithQuantizer = QuantizationNoise<T, feature_dim, options, Other>;
  static constexpr int feature_channels = feature_dim;  ///< as many as the anchors have: check_recipe compares
  static constexpr int steps = options.per_channel ? feature_dim : 1;

  struct Settings {
    double base_step = 1;       ///< Q0 of features
    double least_step = 0;      ///< in units of Q0; the quantizer's own floor of 2^-10 holds always
    double rate_weight = 0;     ///< of -log2(q / Q0), mean over visible anchors and steps
    double least_scale = 1e-6;  ///< exp(scaling) stays above this, world units (docs/spec/method.md, 7.12)
  };
  struct Handles {
    BlockHandle weight1, bias1, weight2, bias2;  ///< "distortion.0.weight" [D, D], "distortion.2.weight" [steps, D], …
  };
  /// What backward needs of the visible rows, compact.
  struct Context {
    Buffer<T> feature;          ///< [n, D] before the noise
    Buffer<T> noise;            ///< [n, D] u
    Buffer<T> raw_step;         ///< [n, steps] r
    Buffer<T> scaling_factor;   ///< [n, 6] d log(exp(s) + noise) / ds
    Buffer<double> partial;     ///< sums a chunk
    Buffer<T> base_step;        ///< [steps] Q0 of a channel, with a DataQuantizer
    Buffer<T> chunk_gradients;  ///< of the network
    DistortionPhase phase;
  };

  QuantizationNoise() = default;
  explicit QuantizationNoise(const Settings& settings) : settings_(settings) {}

  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& arena) {
    constexpr LearningSchedule schedule = LearningSchedule::constant(0.001);
    Handles handles;
    handles.weight1 = arena.add("distortion.0.weight", dim, dim, RowKind::fixed, BlockRole::training, schedule);
    handles.bias1 = arena.add("distortion.0.bias", 1, dim, RowKind::fixed, BlockRole::training, schedule);
    handles.weight2 = arena.add("distortion.2.weight", static_cast<std::size_t>(steps), dim, RowKind::fixed,
                                BlockRole::training, schedule);
    handles.bias2 = arena.add("distortion.2.bias", 1, static_cast<std::size_t>(steps), RowKind::fixed,
                              BlockRole::training, schedule);
    return handles;
  }
  /// First layer U(-1, 1) / sqrt(D); the second starts at zero, so that training begins with q = Q0 exactly.
  static void initialise(ParameterArena<T>& arena, const Handles& handles, std::uint64_t seed) {
    const Random random(seed, 0, random_stage("distortion"));
    const MatrixView<T> weight = arena.values(handles.weight1), bias = arena.values(handles.bias1);
    const double bound = 1 / std::sqrt(static_cast<double>(dim));
    for (std::size_t i = 0; i < weight.size(); ++i) weight.data[i] = static_cast<T>(2 * bound * random.centered(i));
    for (std::size_t i = 0; i < bias.size(); ++i) {
      bias.data[i] = static_cast<T>(2 * bound * random.centered(weight.size() + i));
    }
  }

  /// Distorts the listed rows of the three tables in place.
  template <Executor E>
  DistortionReport forward(const ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                           const DistortionPhase& phase, MatrixView<T> feature, MatrixView<T> scaling,
                           MatrixView<T> offset, Context& context, E& executor) const {
    context.phase = phase;
    const std::size_t n = rows.size();
    context.feature.resize(n * dim);
    context.noise.resize(n * dim);
    context.raw_step.resize(n * static_cast<std::size_t>(steps));
    context.scaling_factor.resize(n * 6);
    context.partial.resize(2 * chunk_count(n, panel));
    const Random feature_noise(phase.seed, phase.iteration, random_stage("distortion of features"));
    const Random scaling_noise(phase.seed, phase.iteration, random_stage("distortion of scaling"));
    const Random offset_noise(phase.seed, phase.iteration, random_stage("distortion of offsets"));
    const Network<const T> network = views(arena, handles);
    if constexpr (DataQuantizer<Quantizer>) {
      if (phase.adaptive) find_base_steps(rows, feature, context);
    }
    executor.for_chunks(n, panel, [&](std::size_t begin, std::size_t end, std::size_t) {
      if (phase.adaptive) {
        Panel p;
        gather(feature, rows, begin, end, p.input);
        heads(network, p);
        distort_adaptive(rows, begin, end, p, feature_noise, phase.round, feature, context);
      } else if (phase.feature_uniform != 0) {
        uniform(rows, begin, end, feature_noise, static_cast<T>(phase.feature_uniform), feature);
      }
      if (phase.offset != 0) uniform(rows, begin, end, offset_noise, static_cast<T>(phase.offset), offset);
      if (phase.scaling != 0) distort_scaling(rows, begin, end, scaling_noise, scaling, context);
    });
    DistortionReport report;
    if (!phase.adaptive || n == 0) return report;
    double sum = 0, sum_log = 0;
    for (std::size_t chunk = 0; chunk < chunk_count(n, panel); ++chunk) {
      sum += context.partial[2 * chunk];
      sum_log += context.partial[2 * chunk + 1];
    }
    const double count = static_cast<double>(n) * steps;
    report.mean_step = sum / count;
    report.rate_loss = -settings_.rate_weight * phase.rate * sum_log / count;
    return report;
  }

  /// The steps of the last forward pass; zeros if it was not adaptive. Cost: a partial sort of them.
  [[nodiscard]] StepSummary step_summary(const Context& context) const {
    StepSummary summary;
    const std::size_t count = context.raw_step.size();
    if (!context.phase.adaptive || count == 0) return summary;
    std::vector<double> relative(count);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t c = i % out;
      relative[i] =
          static_cast<double>(Quantizer::step(context.raw_step[i], base_step(context, c), least_step(context, c))) /
          base(context, c);
      summary.mean += relative[i] / static_cast<double>(count);
    }
    const auto middle = relative.begin() + static_cast<std::ptrdiff_t>((count - 1) / 2);
    std::nth_element(relative.begin(), middle, relative.end());
    summary.median = *middle;
    return summary;
  }

  /// Turns the gradients by the distorted rows into those by the rows before (in place) and ADDS the network's, rate
  /// term included.
  template <Executor E>
  void backward(ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                MatrixView<T> d_feature, MatrixView<T> d_scaling, Context& context, E& executor) const {
    const std::size_t n = rows.size();
    if (context.phase.scaling != 0) {
      executor.for_chunks(n, 1024, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) {
          for (std::size_t c = 0; c < 6; ++c) d_scaling(rows[i], c) *= context.scaling_factor[6 * i + c];
        }
      });
    }
    if (!context.phase.adaptive || n == 0 || (options.detach && settings_.rate_weight == 0)) return;
    const Network<const T> network = views(std::as_const(arena), handles);
    const std::size_t panels = chunk_count(n, panel);
    const std::size_t grain = std::max<std::size_t>(1, (panels + most_partials - 1) / most_partials);
    const std::size_t chunks = chunk_count(panels, grain);
    context.chunk_gradients.resize(chunks * network_size);
    std::fill(context.chunk_gradients.begin(), context.chunk_gradients.end(), T(0));
    const T rate =
        static_cast<T>(-settings_.rate_weight * context.phase.rate / std::log(2.0) / (static_cast<double>(n) * steps));
    executor.for_chunks(panels, grain, [&](std::size_t first, std::size_t last, std::size_t) {
      T* const sums = context.chunk_gradients.data() + first / grain * network_size;
      for (std::size_t index = first; index < last; ++index) {
        const std::size_t begin = index * panel, end = std::min(n, begin + panel);
        Panel p;
        for (std::size_t i = begin; i < end; ++i) {
          for (std::size_t c = 0; c < dim; ++c) p.input[c * panel + i - begin] = context.feature[i * dim + c];
        }
        clear_lanes(p.input, end - begin);
        heads(network, p);
        step_gradients(rows, begin, end, rate, d_feature, context, p);
        network_gradients(network, p, end - begin, sums);
        if constexpr (!options.detach) {
          for (std::size_t i = begin; i < end; ++i) {
            for (std::size_t c = 0; c < dim; ++c) d_feature(rows[i], c) += p.d_input[c * panel + i - begin];
          }
        }
      }
    });
    const BlockHandle blocks[4] = {handles.weight1, handles.bias1, handles.weight2, handles.bias2};
    std::size_t offset = 0;
    for (const BlockHandle block : blocks) {
      const MatrixView<T> gradient = arena.gradients(block);
      for (std::size_t i = 0; i < gradient.size(); ++i) {
        T sum{};
        for (std::size_t chunk = 0; chunk < chunks; ++chunk)
          sum += context.chunk_gradients[chunk * network_size + offset + i];
        gradient.data[i] += sum;
      }
      offset += gradient.size();
    }
  }

 private:
  static constexpr std::size_t dim = static_cast<std::size_t>(feature_dim);
  static constexpr std::size_t out = static_cast<std::size_t>(steps);
  static constexpr std::size_t panel = 64;  // anchors, the lanes of the products
  static constexpr std::size_t most_partials = 64;
  static constexpr std::size_t network_size = dim * dim + dim + out * dim + out;
  static constexpr int W = native_width<T>;

  template <class U>
  struct Network {
    const U *weight1, *bias1, *weight2, *bias2;
  };
  [[nodiscard]] static Network<const T> views(const ParameterArena<T>& arena, const Handles& handles) {
    return {arena.values(handles.weight1).data, arena.values(handles.bias1).data, arena.values(handles.weight2).data,
            arena.values(handles.bias2).data};
  }
  /// Columns of anchors: [channel][lane].
  struct Panel {
    alignas(64) T input[dim * panel];
    alignas(64) T hidden[dim * panel];
    alignas(64) T raw[out * panel];
    alignas(64) T d_raw[out * panel];
    alignas(64) T d_hidden[dim * panel];
    alignas(64) T d_input[dim * panel];
  };

  static void clear_lanes(T* columns, std::size_t valid) {
    for (std::size_t c = 0; c < dim; ++c) std::fill(columns + c * panel + valid, columns + (c + 1) * panel, T(0));
  }
  static void gather(MatrixView<const T> table, std::span<const std::uint32_t> rows, std::size_t begin, std::size_t end,
                     T* columns) {
    for (std::size_t i = begin; i < end; ++i) {
      const T* const row = table.row(rows[i]);
      for (std::size_t c = 0; c < dim; ++c) columns[c * panel + i - begin] = row[c];
    }
    clear_lanes(columns, end - begin);
  }
  static void heads(const Network<const T>& network, Panel& p) {
    constexpr int d = feature_dim, lanes = static_cast<int>(panel);
    constexpr ProductShape first{d, lanes, d, d, 1, lanes, lanes};
    constexpr ProductShape second{steps, lanes, d, d, 1, lanes, lanes};
    product<T, W, first>(network.weight1, p.input, p.hidden, StartBias<T, W>{network.bias1}, FinishRelu<T, W>{});
    product<T, W, second>(network.weight2, p.hidden, p.raw, StartBias<T, W>{network.bias2}, FinishLinear<T, W>{});
  }

  /// Q0 of a step.
  [[nodiscard]] double base([[maybe_unused]] const Context& context, [[maybe_unused]] std::size_t c) const {
    if constexpr (DataQuantizer<Quantizer>) {
      return static_cast<double>(context.base_step[c]);
    } else {
      return settings_.base_step;
    }
  }
  [[nodiscard]] T base_step(const Context& context, std::size_t c) const { return static_cast<T>(base(context, c)); }
  [[nodiscard]] T least_step(const Context& context, std::size_t c) const {
    return static_cast<T>(std::max(settings_.least_step, least_relative_step) * base(context, c));
  }
  /// Of the listed rows' extremes, zero among them. Cost: a read of these rows.
  static void find_base_steps(std::span<const std::uint32_t> rows, MatrixView<const T> feature,
                              Context& context) requires DataQuantizer<Quantizer> {
    std::array<T, dim> low{}, high{};
    for (const std::uint32_t row : rows) {
      for (std::size_t c = 0; c < dim; ++c) {
        low[c] = std::min(low[c], feature(row, c));
        high[c] = std::max(high[c], feature(row, c));
      }
    }
    context.base_step.resize(out);
    for (std::size_t c = 0; c < out; ++c) {
      context.base_step[c] = options.per_channel ? Quantizer::base_step(low[c], high[c])
                                                 : Quantizer::base_step(*std::min_element(low.begin(), low.end()),
                                                                        *std::max_element(high.begin(), high.end()));
    }
  }

  void distort_adaptive(std::span<const std::uint32_t> rows, std::size_t begin, std::size_t end, const Panel& p,
                        const Random& random, bool round, MatrixView<T> feature, Context& context) const {
    double sum = 0, sum_log = 0;
    for (std::size_t i = begin; i < end; ++i) {
      T q[out];
      for (std::size_t c = 0; c < out; ++c) {
        const T r = p.raw[c * panel + i - begin];
        context.raw_step[i * out + c] = r;
        q[c] = Quantizer::step(r, base_step(context, c), least_step(context, c));
        sum += static_cast<double>(q[c]);
        if (settings_.rate_weight != 0) sum_log += std::log2(static_cast<double>(q[c]) / base(context, c));
      }
      T* const row = feature.row(rows[i]);
      for (std::size_t c = 0; c < dim; ++c) {
        const T step = q[options.per_channel ? c : 0];
        const T u = round ? Quantizer::error(row[c], step) : static_cast<T>(random.centered(index(rows[i], c)));
        context.feature[i * dim + c] = row[c];
        context.noise[i * dim + c] = u;
        row[c] += step * u;
      }
    }
    context.partial[2 * (begin / panel)] = sum;
    context.partial[2 * (begin / panel) + 1] = sum_log;
  }
  static void uniform(std::span<const std::uint32_t> rows, std::size_t begin, std::size_t end, const Random& random,
                      T width, MatrixView<T> table) {
    for (std::size_t i = begin; i < end; ++i) {
      T* const row = table.row(rows[i]);
      for (std::size_t c = 0; c < table.columns; ++c) {
        row[c] += width * static_cast<T>(random.centered(index(rows[i], c)));
      }
    }
  }
  /// The noise is on the scale, the table holds its logarithm.
  void distort_scaling(std::span<const std::uint32_t> rows, std::size_t begin, std::size_t end, const Random& random,
                       MatrixView<T> scaling, Context& context) const {
    const T width = static_cast<T>(context.phase.scaling), least = static_cast<T>(settings_.least_scale);
    for (std::size_t i = begin; i < end; ++i) {
      T* const row = scaling.row(rows[i]);
      for (std::size_t c = 0; c < 6; ++c) {
        const T scale = std::exp(row[c]);
        const T noisy = scale + width * static_cast<T>(random.centered(index(rows[i], c)));
        const bool held = !(noisy > least);
        context.scaling_factor[6 * i + c] = held ? T(0) : scale / noisy;
        row[c] = std::log(held ? least : noisy);
      }
    }
  }

  /// p.d_raw from the gradient of the distorted features and from the rate term.
  void step_gradients(std::span<const std::uint32_t> rows, std::size_t begin, std::size_t end, T rate,
                      MatrixView<const T> d_feature, const Context& context, Panel& p) const {
    std::fill(std::begin(p.d_raw), std::end(p.d_raw), T(0));
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t lane = i - begin;
      if constexpr (!options.detach) {
        const T* const d = d_feature.row(rows[i]);
        const T* const u = context.noise.data() + i * dim;
        for (std::size_t c = 0; c < dim; ++c) p.d_raw[(options.per_channel ? c : 0) * panel + lane] += d[c] * u[c];
      }
      for (std::size_t c = 0; c < out; ++c) {
        const T r = context.raw_step[i * out + c];
        T& d = p.d_raw[c * panel + lane];
        d *= Quantizer::step_slope(r, base_step(context, c), least_step(context, c));
        if (rate != T(0)) d += rate * Quantizer::step_log_slope(r);
      }
    }
  }
  /// Adds the panel's share of the network's gradients, in the order of the blocks, and leaves p.d_input.
  static void network_gradients(const Network<const T>& network, Panel& p, std::size_t valid, T* sums) {
    constexpr int d = feature_dim, lanes = static_cast<int>(panel);
    constexpr ProductShape back2{d, lanes, steps, 1, d, lanes, lanes};  // W2^T
    constexpr ProductShape back1{d, lanes, d, 1, d, lanes, lanes};      // W1^T
    product<T, W, back2>(network.weight2, p.d_raw, p.d_hidden, StartZero<T, W>{}, FinishLinear<T, W>{});
    for (std::size_t i = 0; i < dim * panel; ++i) p.d_hidden[i] = p.hidden[i] > T(0) ? p.d_hidden[i] : T(0);
    product<T, W, back1>(network.weight1, p.d_hidden, p.d_input, StartZero<T, W>{}, FinishLinear<T, W>{});
    T* const bias1 = sums + dim * dim;
    T* const weight2 = bias1 + dim;
    T* const bias2 = weight2 + out * dim;
    outer(p.d_hidden, dim, p.input, valid, sums, bias1);
    outer(p.d_raw, out, p.hidden, valid, weight2, bias2);
  }
  /// weight[o][c] += sum over lanes of left[o][lane] right[c][lane]; bias[o] += sum of left[o].
  static void outer(const T* left, std::size_t count, const T* right, std::size_t valid, T* weight, T* bias) {
    using P = Pack<T, W>;
    const std::size_t used = (valid + W - 1) / W * W;  // lanes behind `valid` are zero on the left
    for (std::size_t o = 0; o < count; ++o) {
      const T* const a = left + o * panel;
      P total{};
      for (std::size_t lane = 0; lane < used; lane += W) total += P::load(a + lane);
      bias[o] += reduce_add(total);
      for (std::size_t c = 0; c < dim; ++c) {
        P sum{};
        for (std::size_t lane = 0; lane < used; lane += W)
          sum = fma(P::load(a + lane), P::load(right + c * panel + lane), sum);
        weight[o * dim + c] += reduce_add(sum);
      }
    }
  }
  [[nodiscard]] static std::uint64_t index(std::uint32_t row, std::size_t column) {
    return static_cast<std::uint64_t>(row) << 8 | column;
  }

  Settings settings_;
};

}  // namespace compmark
