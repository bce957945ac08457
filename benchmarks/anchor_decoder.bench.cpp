// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The heads of the anchor decoder, D = 32, K = 10, gather from the row-major table and writing of the Gaussians
// included. Operations are those of the published formulas, 13,760 an anchor forward and twice that backward (the
// recomputation of the hidden layer is not counted: it is ours); bytes are the table read in both passes, its gradient
// read and written, and the Gaussians with what is kept for backward. `floor` is time over the larger of operations /
// measured rate and bytes / measured bandwidth. Beside it: the same three heads as Eigen matrix products (inputs ready
// made, no Gaussians written), and the plain reference. Last: the visibility prefilter.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored \
    "-Wmaybe-uninitialized"  // false in g++ 12's own AVX-512 header, once Eigen's reductions are inlined
#endif

#include <benchmark/benchmark.h>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/mlp_decoder.hpp"
#include "compmark/splat/anchor/reference_decoder.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/anchor/visibility.hpp"
#include "support/ceiling.hpp"

namespace {

using namespace compmark;
using Clock = std::chrono::steady_clock;

constexpr double forward_flops = 2.0 * (35 * 96 + 32 * 110);

template <class Decoder>
struct Problem {
  ParameterArena<float> arena;
  AnchorHandles anchors;
  typename Decoder::Handles heads;
  Decoder decoder;
  typename Decoder::Context context;
  GaussianBatch<float> gaussians, d_gaussians;
  std::vector<std::uint32_t> visible;
  ThreadExecutor executor;

  /// One anchor in `stride` gets a gradient: a trained scene is like 2, because half of it is occluded.
  Problem(std::size_t n, std::size_t threads, std::uint32_t stride = 1) : visible(n), executor(threads) {
    anchors = add_anchor_blocks(arena, n, Decoder::shape);
    heads = Decoder::add_parameters(arena, 1);
    Decoder::initialise(arena, heads, 1);
    const auto fill = [&](BlockHandle block, double mean, double deviation) {
      const Random random(2, 0, block.index);
      std::size_t i = 0;
      for (float& value : arena.values(block).flat()) value = static_cast<float>(mean + deviation * random.normal(i++));
    };
    fill(anchors.position, 0, 1);
    fill(anchors.offset, 0, 0.5);
    fill(anchors.scaling, -3, 0.3);
    fill(anchors.feature, 0, 1);
    std::iota(visible.begin(), visible.end(), 0u);
    d_gaussians.resize(forward());
    const auto slots = decoder.statistics(context).gaussian_slot;
    const GaussianColumns<float> d = d_gaussians.columns();
    d_gaussians.set_zero();
    for (std::size_t row = 0; row < slots.size(); ++row) {
      if (slots[row] / 10 % stride != 0) continue;
      const float value = static_cast<float>(Random(3, 0, 0).normal(row));
      for (float* column : d.mean) column[row] = value;
      for (float* column : d.scale) column[row] = -value;
      for (float* column : d.rotation) column[row] = value;
      for (float* column : d.color) column[row] = value;
      d.opacity[row] = value;
    }
  }
  std::size_t forward() {
    return decoder.forward(anchor_values(std::as_const(arena), anchors), visible, {0.1, 0.2, 4}, 0, arena, heads,
                           gaussians, context, executor);
  }
  void backward() {
    decoder.backward(anchor_values(std::as_const(arena), anchors), visible, {0.1, 0.2, 4}, 0, arena, heads,
                     std::as_const(d_gaussians).columns(), anchor_gradients(arena, anchors), context, executor);
  }
  double forward_bytes() const {
    return static_cast<double>(visible.size()) * 4 * (71 + 35) + static_cast<double>(gaussians.size()) * 4 * 16;
  }
  double backward_bytes() const {
    return static_cast<double>(visible.size()) * 4 * 71 * 3 + static_cast<double>(gaussians.size()) * 4 * 25;
  }
};

/// Time is the best iteration: a shared machine's mean says more about its other users.
template <class Body>
void measure(benchmark::State& state, double items, double flops, double bytes, std::size_t threads, const Body& body) {
  body();
  double best = 1e9;
  for (auto _ : state) {
    const auto start = Clock::now();
    body();
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    best = std::min(best, seconds);
    state.SetIterationTime(seconds);
  }
  state.counters["best_ms"] = best * 1e3;
  state.counters["items/s"] = items / best;
  state.counters["GFLOP/s"] = flops / best * 1e-9;
  state.counters["GB/s"] = bytes / best * 1e-9;
  state.counters["floor"] = benchmarks::distance_from_floor(best, flops, bytes, threads);
}

using Fast = MlpDecoder<float>;

void decoder_forward(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0)), threads = static_cast<std::size_t>(state.range(1));
  Problem<Fast> p(n, threads);
  measure(state, static_cast<double>(n), forward_flops * static_cast<double>(n), p.forward_bytes(), threads,
          [&] { p.forward(); });
}
void decoder_backward(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0)), threads = static_cast<std::size_t>(state.range(1));
  const auto stride = static_cast<std::uint32_t>(state.range(2));
  Problem<Fast> p(n, threads, stride);
  measure(state, static_cast<double>(n), 2 * forward_flops * static_cast<double>(n) / stride, p.backward_bytes(),
          threads, [&] { p.backward(); });
}
void decoder_both(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0)), threads = static_cast<std::size_t>(state.range(1));
  Problem<Fast> p(n, threads);
  measure(state, static_cast<double>(n), 3 * forward_flops * static_cast<double>(n),
          p.forward_bytes() + p.backward_bytes(), threads, [&] {
            p.forward();
            p.backward();
          });
}
void reference_both(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  Problem<ReferenceDecoder<float>> p(n, 1);
  measure(state, static_cast<double>(n), 3 * forward_flops * static_cast<double>(n),
          p.forward_bytes() + p.backward_bytes(), 1, [&] {
            p.forward();
            p.backward();
          });
}

/// Three heads forward and backward as Eigen products over panels of rows, one set of weight gradients a worker.
void eigen_both(benchmark::State& state) {
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto n = state.range(0);
  const auto threads = static_cast<std::size_t>(state.range(1));
  constexpr Eigen::Index outputs[3] = {10, 70, 30};
  constexpr std::size_t grain = 512;
  struct Worker {
    std::array<Matrix, 3> d_weight1, d_weight2;
    Matrix hidden, output, d_output, d_hidden;
  };
  Matrix input = Matrix::Random(n, 35), d_input = Matrix::Zero(n, 35);
  std::array<Matrix, 3> weight1, weight2, target;
  std::vector<Worker> workers(threads);
  for (std::size_t head = 0; head < 3; ++head) {
    weight1[head] = Matrix::Random(32, 35);
    weight2[head] = Matrix::Random(outputs[head], 32);
    target[head] = Matrix::Random(n, outputs[head]);
    for (Worker& worker : workers) {
      worker.d_weight1[head] = Matrix::Zero(32, 35);
      worker.d_weight2[head] = Matrix::Zero(outputs[head], 32);
    }
  }
  ThreadExecutor executor(threads);
  measure(state, static_cast<double>(n), 3 * forward_flops * static_cast<double>(n), 0, threads, [&] {
    executor.for_chunks(static_cast<std::size_t>(n), grain, [&](std::size_t begin, std::size_t end, std::size_t id) {
      Worker& w = workers[id];
      const auto first = static_cast<Eigen::Index>(begin), rows = static_cast<Eigen::Index>(end - begin);
      const auto x = input.middleRows(first, rows);
      for (std::size_t head = 0; head < 3; ++head) {
        w.hidden.noalias() = x * weight1[head].transpose();
        w.hidden = w.hidden.cwiseMax(0.0f);
        w.output.noalias() = w.hidden * weight2[head].transpose();
        if (head == 0) w.output = w.output.array().tanh().matrix();
        if (head == 2) w.output = w.output.array().logistic().matrix();
        w.d_output = w.output - target[head].middleRows(first, rows);
        w.d_weight2[head].noalias() += w.d_output.transpose() * w.hidden;
        w.d_hidden.noalias() = w.d_output * weight2[head];
        w.d_hidden = (w.hidden.array() > 0).select(w.d_hidden, 0.0f);
        w.d_weight1[head].noalias() += w.d_hidden.transpose() * x;
        d_input.middleRows(first, rows).noalias() += w.d_hidden * weight1[head];
      }
    });
    benchmark::DoNotOptimize(d_input.data());
  });
}

void visibility(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0)), threads = static_cast<std::size_t>(state.range(1));
  Problem<Fast> p(n, threads);
  Camera<float> camera;
  camera.width = camera.height = 800;
  camera.fx = camera.fy = 1111;
  camera.cx = camera.cy = 400;
  camera.center_world = {0, 0, -4};
  Buffer<std::uint32_t> visible;
  VisibilityWorkspace workspace;
  measure(state, static_cast<double>(n), 110.0 * static_cast<double>(n), 40.0 * static_cast<double>(n), threads, [&] {
    visible_anchors(anchor_values(std::as_const(p.arena), p.anchors), camera, {}, visible, workspace, p.executor);
  });
  state.counters["visible"] = static_cast<double>(visible.size());
}

BENCHMARK(decoder_forward)->ArgsProduct({{20000, 100000}, {1, 2}})->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(decoder_backward)
    ->ArgsProduct({{20000, 100000}, {1, 2}, {1, 2}})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(decoder_both)->ArgsProduct({{20000, 100000}, {1, 2}})->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(eigen_both)->ArgsProduct({{20000, 100000}, {1, 2}})->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(reference_both)->Arg(2000)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(visibility)->ArgsProduct({{100000}, {1, 2}})->UseManualTime()->Unit(benchmark::kMillisecond);

}  // namespace
