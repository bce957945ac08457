// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Convolutions of the watermark decoders: direct and Winograd, forward, gradient to the input, gradient to the weights,
// and eight layers of 64 channels forward and backward (the HiDDeN decoder without its head). GFLOP/s are effective: 2
// in out 9 operations a pixel whatever the policy; `floor` is best time / (operations the policy needs / multiply-add
// rate measured at start), so 1 is perfect: Winograd needs n^2 / (9 m^2) of them. `error` is the largest error over the
// sum of |w| |x|, from the same layer in double. The peer, where it is installed, is oneDNN with its Winograd and its
// direct algorithm in its own blocked layouts (reorders not counted).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#if defined(COMPMARK_PEER_DNNL)
#include <oneapi/dnnl/dnnl.hpp>
#endif

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/math/conv_backward.hpp"
#include "compmark/math/winograd.hpp"
#include "support/ceiling.hpp"

namespace {

using namespace compmark;

std::vector<float> noise(std::size_t n, std::uint64_t seed = 1) {
  const Random random(seed, 2, 3);
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = random.centered(i);
  return values;
}

template <class T>
FeatureView<const T> dense(const std::vector<T>& values, int channels, int side) {
  const std::size_t w = static_cast<std::size_t>(side);
  return {values.data(), channels, side, side, w, w * w};
}

/// `flops` of the direct definition, of which the policy needs `share`.
template <class Run>
void measure(benchmark::State& bench, std::size_t threads, double flops, double share, const Run& run) {
  const double rate = benchmarks::ceiling(threads).flops;
  run();  // warm up: scratch is allocated
  double best = 1e9;
  for (auto _ : bench) {
    const auto start = std::chrono::steady_clock::now();
    run();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    bench.SetIterationTime(seconds);
    best = std::min(best, seconds);
  }
  bench.counters["best_ms"] = best * 1e3;
  bench.counters["GFLOP/s"] = flops / best * 1e-9;
  bench.counters["ceiling_GFLOP/s"] = rate * 1e-9;
  bench.counters["floor"] = best / (flops * share / rate);
}

/// in, out, side, threads
struct Layer {
  ConvShape shape;
  int side;
  std::size_t threads;
  std::vector<float> input, output, weight, bias;

  explicit Layer(const benchmark::State& bench)
      : shape{static_cast<int>(bench.range(0)), static_cast<int>(bench.range(1)), 3, 1, 1},
        side(static_cast<int>(bench.range(2))),
        threads(static_cast<std::size_t>(bench.range(3))),
        input(noise(static_cast<std::size_t>(shape.in * side * side), 1)),
        output(noise(static_cast<std::size_t>(shape.out * side * side), 2)),
        weight(noise(static_cast<std::size_t>(shape.out) * shape.taps(), 3)),
        bias(noise(static_cast<std::size_t>(shape.out), 4)) {}

  [[nodiscard]] double flops() const { return 2.0 * shape.in * shape.out * 9 * side * side; }
};

template <class Policy>
constexpr double share = 1;
template <class T, int Tile, class Points>
constexpr double share<WinogradConvolution<T, Tile, Points>> = (Tile + 2) * (Tile + 2) / (9.0 * Tile * Tile);
template <class T, int Tile, class Points>
constexpr double share<WinogradInputGradient<T, Tile, Points>> = share<WinogradConvolution<T, Tile, Points>>;

template <class Policy, class T, class E>
std::vector<double> outputs_of(const ConvShape& shape, int side, const std::vector<T>& x, const std::vector<T>& w,
                               const std::vector<T>& b, E& executor) {
  const Policy policy(shape, w, b);
  FeatureMaps<T> maps;
  typename Policy::Scratch scratch;
  policy.resize_output(dense(x, shape.in, side), maps);
  policy.forward(dense(x, shape.in, side), maps.view(), scratch, executor, IdentityFinish{});
  std::vector<double> values;
  for (int c = 0; c < shape.out; ++c) {
    for (int y = 0; y < side; ++y) values.insert(values.end(), maps.view().row(c, y), maps.view().row(c, y) + side);
  }
  return values;
}

template <class Policy, class E>
double error_of(const Layer& layer, E& executor) {
  const int side = std::min(layer.side, 64);
  std::vector<double> parts[3], sizes[3];
  const std::vector<float>* sources[3] = {&layer.input, &layer.weight, &layer.bias};
  for (int i = 0; i < 3; ++i) {
    parts[i].assign(sources[i]->begin(), sources[i]->end());
    sizes[i] = parts[i];
    for (double& v : sizes[i]) v = std::abs(v);
  }
  const auto exact = outputs_of<Convolution<double>>(layer.shape, side, parts[0], parts[1], parts[2], executor);
  const auto scale = outputs_of<Convolution<double>>(layer.shape, side, sizes[0], sizes[1], sizes[2], executor);
  const auto found = outputs_of<Policy>(layer.shape, side, layer.input, layer.weight, layer.bias, executor);
  double worst = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) worst = std::max(worst, std::abs(found[i] - exact[i]) / scale[i]);
  return worst;
}

template <class Policy>
void forward(benchmark::State& bench) {
  const Layer layer(bench);
  ThreadExecutor executor(layer.threads);
  const Policy policy(layer.shape, layer.weight, layer.bias);
  FeatureMaps<float> maps;
  typename Policy::Scratch scratch;
  const auto view = dense(layer.input, layer.shape.in, layer.side);
  measure(bench, layer.threads, layer.flops(), share<Policy>, [&] {
    policy.resize_output(view, maps);
    policy.forward(view, maps.view(), scratch, executor, ReluFinish{});
  });
  bench.counters["error"] = error_of<Policy>(layer, executor);
}

template <class Policy>
void input_gradient(benchmark::State& bench) {
  const Layer layer(bench);
  ThreadExecutor executor(layer.threads);
  const Policy policy(layer.shape, layer.weight);
  FeatureMaps<float> maps;
  typename Policy::Scratch scratch;
  const auto view = dense(layer.output, layer.shape.out, layer.side);
  measure(bench, layer.threads, layer.flops(), share<Policy>, [&] {
    policy.resize_input_gradient(view, layer.side, layer.side, maps);
    policy.backward(view, maps.view(), scratch, executor);
  });
}

void weight_gradient(benchmark::State& bench) {
  const Layer layer(bench);
  ThreadExecutor executor(layer.threads);
  ConvInput<float> packed;
  ConvWeightScratch<float> scratch;
  std::vector<float> weight(layer.weight.size()), bias(layer.bias.size());
  packed.pack(dense(layer.input, layer.shape.in, layer.side), 1, 1, executor);
  measure(bench, layer.threads, layer.flops(), 1, [&] {
    convolution_weight_gradient<float>(layer.shape, packed, dense(layer.output, layer.shape.out, layer.side), weight,
                                       bias, scratch, executor);
  });
}

/// Eight layers 3 -> 64 -> ... -> 64 with ReLU, forward and the gradient to the image.
template <class Policy, class Adjoint>
void decoder(benchmark::State& bench) {
  constexpr int depth = 8, width = 64;
  const int side = static_cast<int>(bench.range(0));
  const std::size_t threads = static_cast<std::size_t>(bench.range(1)), pixels = static_cast<std::size_t>(side * side);
  ThreadExecutor executor(threads);
  std::vector<Policy> layers(depth);
  std::vector<Adjoint> adjoints(depth);
  double flops = 0;
  for (std::size_t l = 0; l < depth; ++l) {
    const ConvShape shape{l == 0 ? 3 : width, width, 3, 1, 1};
    const auto weight = noise(width * shape.taps(), l);
    layers[l].assign(shape, weight, noise(width, l + 9));
    adjoints[l].assign(shape, weight);
    flops += 2 * 2.0 * width * static_cast<double>(shape.taps() * pixels);
  }
  const auto image = noise(3 * pixels), gradient = noise(width * pixels);
  std::vector<FeatureMaps<float>> maps(depth), gradients(depth);
  typename Policy::Scratch scratch;
  typename Adjoint::Scratch adjoint_scratch;
  measure(bench, threads, flops, share<Policy>, [&] {
    for (std::size_t l = 0; l < depth; ++l) {
      const auto input = l == 0 ? dense(image, 3, side) : std::as_const(maps[l - 1]).view();
      layers[l].resize_output(input, maps[l]);
      layers[l].forward(input, maps[l].view(), scratch, executor, ReluFinish{});
    }
    for (std::size_t l = depth; l-- > 0;) {  // the layer's input says where its ReLU let the gradient through
      const auto output = l + 1 == depth ? dense(gradient, width, side) : std::as_const(gradients[l + 1]).view();
      const float* const activation = l == 0 ? nullptr : maps[l - 1].view().data;
      const auto relu = [&](auto value, const ConvPlace<float>& place) {
        return select(place.load(activation) > decltype(value)(0.0f), value, decltype(value)(0.0f));
      };
      adjoints[l].resize_input_gradient(output, side, side, gradients[l]);
      if (l == 0) {
        adjoints[l].backward(output, gradients[l].view(), adjoint_scratch, executor);
      } else {
        adjoints[l].backward(output, gradients[l].view(), adjoint_scratch, executor, relu);
      }
    }
  });
}

void layers(benchmark::internal::Benchmark* b) {
  for (const int threads : {1, 2}) {
    for (const int side : {64, 128, 200}) b->Args({64, 64, side, threads});
  }
  b->Args({3, 64, 128, 2})->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(0.3);
}

BENCHMARK_TEMPLATE(forward, Convolution<float>)->Name("forward/direct")->Apply(layers);
BENCHMARK_TEMPLATE(forward, WinogradConvolution<float, 2>)->Name("forward/F2")->Apply(layers);
BENCHMARK_TEMPLATE(forward, WinogradConvolution<float, 4>)->Name("forward/F4")->Apply(layers);
BENCHMARK_TEMPLATE(forward, WinogradConvolution<float, 6>)->Name("forward/F6")->Apply(layers);
BENCHMARK_TEMPLATE(input_gradient, ConvInputGradient<float>)->Name("input_gradient/direct")->Apply(layers);
BENCHMARK_TEMPLATE(input_gradient, WinogradInputGradient<float, 2>)->Name("input_gradient/F2")->Apply(layers);
BENCHMARK_TEMPLATE(input_gradient, WinogradInputGradient<float, 4>)->Name("input_gradient/F4")->Apply(layers);
BENCHMARK(weight_gradient)->Name("weight_gradient/direct")->Apply(layers);
BENCHMARK_TEMPLATE(decoder, Convolution<float>, ConvInputGradient<float>)
    ->Name("decoder_8x64/direct/side/threads")
    ->Args({128, 2})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(decoder, WinogradConvolution<float>, WinogradInputGradient<float>)
    ->Name("decoder_8x64/F4/side/threads")
    ->Args({128, 1})
    ->Args({128, 2})
    ->Args({200, 2})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

#if defined(COMPMARK_PEER_DNNL)
/// The peer: forward or gradient to the input, in the layouts it asks for.
template <bool Backward, bool Winograd>
void onednn(benchmark::State& bench) {
  constexpr auto algorithm = Winograd ? dnnl::algorithm::convolution_winograd : dnnl::algorithm::convolution_direct;
  using Memory = dnnl::memory;
  const Layer layer(bench);
  const dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  dnnl::stream stream(engine);
  const auto description = [](Memory::dims dims) {
    return Memory::desc(dims, Memory::data_type::f32, Memory::format_tag::any);
  };
  const int s = layer.side;
  const Memory::dims strides{1, 1}, padding{1, 1};
  const auto in = description({1, layer.shape.in, s, s}), out = description({1, layer.shape.out, s, s}),
             weight = description({layer.shape.out, layer.shape.in, 3, 3});
  try {
    const dnnl::convolution_forward::primitive_desc ahead(
        {dnnl::prop_kind::forward_inference, algorithm, in, weight, out, strides, padding, padding}, engine);
    if constexpr (Backward) {
      const dnnl::convolution_backward_data::primitive_desc chosen(
          {algorithm, in, weight, out, strides, padding, padding}, engine, ahead);
      Memory x(chosen.diff_src_desc(), engine), w(chosen.weights_desc(), engine), y(chosen.diff_dst_desc(), engine);
      dnnl::convolution_backward_data primitive(chosen);
      measure(bench, layer.threads, layer.flops(), 1, [&] {
        primitive.execute(stream, {{DNNL_ARG_DIFF_SRC, x}, {DNNL_ARG_WEIGHTS, w}, {DNNL_ARG_DIFF_DST, y}});
        stream.wait();
      });
    } else {
      Memory x(ahead.src_desc(), engine), w(ahead.weights_desc(), engine), y(ahead.dst_desc(), engine);
      dnnl::convolution_forward primitive(ahead);
      measure(bench, layer.threads, layer.flops(), 1, [&] {
        primitive.execute(stream, {{DNNL_ARG_SRC, x}, {DNNL_ARG_WEIGHTS, w}, {DNNL_ARG_DST, y}});
        stream.wait();
      });
    }
  } catch (const dnnl::error& error) {
    bench.SkipWithError(error.what());
  }
}
void peer_layers(benchmark::internal::Benchmark* b) {
  const int threads = static_cast<int>(std::thread::hardware_concurrency());  // oneDNN takes OMP_NUM_THREADS or all
  for (const int side : {128, 200}) b->Args({64, 64, side, threads});
  b->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(0.3);
}
BENCHMARK_TEMPLATE(onednn, false, true)->Name("forward/onednn_winograd")->Apply(peer_layers);
BENCHMARK_TEMPLATE(onednn, true, true)->Name("input_gradient/onednn_winograd")->Apply(peer_layers);
BENCHMARK_TEMPLATE(onednn, false, false)->Name("forward/onednn_direct")->Apply(peer_layers);
#endif

}  // namespace
