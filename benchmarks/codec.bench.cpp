// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The codecs at the published sizes (D = 50, K = 10, HAC's context 96 -> 100 -> 175, ContextGS' three networks) on
// synthetic models: whole files both ways by threads, the integer contexts by themselves, the octree, and the checks
// (CRC-32C, SHA-256). `symbols/s` counts all scalars of a file over the whole of its coding, context included; `bits`
// are those of a scalar. Published coders need seconds of a GPU for larger scenes.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "compmark/codec/container/cmk.hpp"
#include "compmark/core/thread_executor.hpp"
#include "support/codec_model.hpp"
#include "support/context_gs_model.hpp"

namespace {

using namespace compmark;

const CodecModel& model_of(std::size_t anchors) {
  static std::map<std::size_t, CodecModel> models;
  auto found = models.find(anchors);
  if (found == models.end()) {
    found = models.emplace(anchors, testing::make_codec_model(1, testing::full_codec_model(anchors))).first;
  }
  return found->second;
}
const CodecEncoded& file_of(std::size_t anchors) {
  static std::map<std::size_t, CodecEncoded> files;
  auto found = files.find(anchors);
  if (found == files.end()) {
    SerialExecutor executor;
    auto encoded = encode_hac(model_of(anchors), {}, executor);
    if (!encoded) std::abort();
    found = files.emplace(anchors, std::move(*encoded)).first;
  }
  return found->second;
}
double symbols_in(const CodecReport& report) {
  return static_cast<double>(report.symbols[0] + report.symbols[1] + report.symbols[2]);
}
void count(benchmark::State& state, const CodecReport& report) {
  const double symbols = symbols_in(report);
  state.counters["symbols/s"] = benchmark::Counter(symbols, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["us_anchor"] =
      benchmark::Counter(static_cast<double>(report.anchors) * 1e-6,
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["bits"] = 8 * static_cast<double>(report.bytes_of(HacFormat::stream)) / symbols;
  state.counters["bytes"] = static_cast<double>(report.total_bytes);
}

void encode(benchmark::State& state) {
  const CodecModel& model = model_of(static_cast<std::size_t>(state.range(0)));
  ThreadExecutor executor(static_cast<std::size_t>(state.range(1)));
  for (auto _ : state) {
    const auto encoded = encode_hac(model, {}, executor);
    benchmark::DoNotOptimize(encoded.ok());
  }
  count(state, file_of(static_cast<std::size_t>(state.range(0))).report);
}
void decode(benchmark::State& state) {
  const CodecEncoded& file = file_of(static_cast<std::size_t>(state.range(0)));
  ThreadExecutor executor(static_cast<std::size_t>(state.range(1)));
  for (auto _ : state) {
    const auto decoded = decode_hac(file.bytes, "", {}, executor);
    if (!decoded) std::abort();
    benchmark::DoNotOptimize(decoded->verified);
  }
  count(state, file.report);
}
const CodecEncoded& context_gs_file(std::size_t anchors) {
  static std::map<std::size_t, CodecEncoded> files;
  auto found = files.find(anchors);
  if (found == files.end()) {
    ThreadExecutor executor(0);
    auto encoded =
        encode_context_gs(testing::make_context_gs_model(1, testing::full_codec_model(anchors)), {}, executor);
    if (!encoded) std::abort();
    found = files.emplace(anchors, std::move(*encoded)).first;
  }
  return found->second;
}
/// Without the search for the bits of the weights, which is `context_gs_search`.
void context_gs_encode(benchmark::State& state) {
  const CodecEncoded& file = context_gs_file(static_cast<std::size_t>(state.range(0)));
  ThreadExecutor executor(static_cast<std::size_t>(state.range(1)));
  for (auto _ : state) {
    const auto encoded = encode_context_gs(file.model, {}, executor);
    benchmark::DoNotOptimize(encoded.ok());
  }
  count(state, file.report);
}
void context_gs_decode(benchmark::State& state) {
  const CodecEncoded& file = context_gs_file(static_cast<std::size_t>(state.range(0)));
  ThreadExecutor executor(static_cast<std::size_t>(state.range(1)));
  for (auto _ : state) {
    const auto decoded = decode_context_gs(file.bytes, "", {}, executor);
    if (!decoded) std::abort();
    benchmark::DoNotOptimize(decoded->verified);
  }
  count(state, file.report);
  state.counters["bits_z"] = file.report.hyperprior_bits / static_cast<double>(file.report.hyperprior_symbols);
}
void context_gs_search(benchmark::State& state) {
  const CodecModel model = testing::make_context_gs_model(1, testing::full_codec_model(20'000));
  ThreadExecutor executor(2);
  for (auto _ : state) benchmark::DoNotOptimize(encode_context_gs(model, {}, executor).ok());
}
/// Levels, parents and the order of coding, from voxels.
void context_gs_levels(benchmark::State& state) {
  const CodecModel& model = file_of(20'000).model;
  const AnchorCells cells = choose_anchor_cells(model.voxels);
  for (auto _ : state) benchmark::DoNotOptimize(detail::context_gs_order(model.voxels, cells).row.data());
  state.counters["us_anchor"] =
      benchmark::Counter(static_cast<double>(model.anchors()) * 1e-6,
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(context_gs_encode)->Args({20'000, 1})->Args({20'000, 2})->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(context_gs_decode)
    ->Args({20'000, 1})
    ->Args({20'000, 2})
    ->Args({400'000, 2})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(context_gs_search)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(context_gs_levels)->Unit(benchmark::kMillisecond);
BENCHMARK(encode)->Args({20'000, 1})->Args({20'000, 2})->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(decode)
    ->Args({20'000, 1})
    ->Args({20'000, 2})
    ->Args({400'000, 2})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void context(benchmark::State& state) {
  const CodecEncoded& file = file_of(20'000);
  const IntegerContext& integers = *file.model.context;
  const IntegerNetwork::Packed packed = integers.network.pack();
  ContextEvaluator evaluator(integers, packed);
  std::vector<SymbolModel> models;
  std::size_t first = 0, anchors = 0;
  for (auto _ : state) {
    evaluator.evaluate(std::span<const Voxel>(file.model.voxels).subspan(first, integer_panel));
    if (state.range(0) != 0) {
      models.clear();
      for (std::size_t lane = 0; lane < integer_panel; ++lane) {
        detail::append_models(evaluator, integers.heads, file.model.mask[first + lane], lane, models);
      }
      benchmark::DoNotOptimize(models.data());
    }
    first = first + 2 * integer_panel < file.model.anchors() ? first + integer_panel : 0;
    anchors += integer_panel;
  }
  state.counters["us_anchor"] = benchmark::Counter(static_cast<double>(anchors) * 1e-6,
                                                   benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(context)->ArgName("models")->Arg(0)->Arg(1);

void grid(benchmark::State& state) {
  const CodecEncoded& file = file_of(20'000);
  const IntegerHashGrid& integers = file.model.context->grid;
  std::vector<std::int16_t> panel(96 * integer_panel);
  std::size_t first = 0, anchors = 0;
  for (auto _ : state) {
    integers.evaluate(std::span<const Voxel>(file.model.voxels).subspan(first, integer_panel), panel.data());
    benchmark::DoNotOptimize(panel.data());
    benchmark::ClobberMemory();
    first = first + 2 * integer_panel < file.model.anchors() ? first + integer_panel : 0;
    anchors += integer_panel;
  }
  state.counters["us_anchor"] = benchmark::Counter(static_cast<double>(anchors) * 1e-6,
                                                   benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(grid);

void octree(benchmark::State& state) {
  const CodecModel& model = file_of(20'000).model;
  const VoxelRange range = voxel_range(model.voxels);
  const std::vector<std::byte> bytes = encode_geometry(model.voxels, range);
  for (auto _ : state) {
    if (state.range(0) == 0) {
      benchmark::DoNotOptimize(encode_geometry(model.voxels, range).size());
    } else {
      benchmark::DoNotOptimize(decode_geometry(bytes, model.anchors()).ok());
    }
  }
  state.counters["us_anchor"] =
      benchmark::Counter(static_cast<double>(model.anchors()) * 1e-6,
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["bits_anchor"] = 8 * static_cast<double>(bytes.size()) / static_cast<double>(model.anchors());
}
BENCHMARK(octree)->ArgName("decode")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

void checks(benchmark::State& state) {
  const std::vector<std::byte>& bytes = file_of(20'000).bytes;
  for (auto _ : state) {
    if (state.range(0) == 0) {
      benchmark::DoNotOptimize(crc32c(bytes));
    } else {
      benchmark::DoNotOptimize(Sha256().update(bytes).hex().size());
    }
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations()) * static_cast<std::int64_t>(bytes.size()));
}
BENCHMARK(checks)->ArgName("sha256")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
