// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What accuracy costs in time, third part: bits a scalar against symbols a second, for every knob of the coding side
// turned away from what is shipped: precision of the frequencies and their floor, grids of deviation and mean, tables
// against erfc, symbols a chunk; and of whole files, context included: bits of the context network's weights, anchors a
// chunk, threads.
//
//   accuracy_vs_time_codec [MODEL.safetensors] [--symbols N] [--anchors N] [--repetitions N] [--json FILE] [--html
//     FILE] [--svg FILE]
//
// Symbols are those of the trained model (recipe hac) with the Gaussians of its context, or drawn from Gaussians; the
// ideal is what these cost in long double, and the excess is what a coder needs more. Times are the best of the
// repetitions, the cases interleaved: of symbols, and of files on one thread, the thread's processor time; of files on
// more, wall clock. Every case decodes to what went in, or the program stops.
#include <ctime>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../examples/compmark/plain_page.hpp"
#include "compmark/codec/hac/hac_decoder.hpp"
#include "compmark/codec/hac/hac_encoder.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/recipes/hac.hpp"
#include "support/codec_cases.hpp"
#include "support/codec_model.hpp"

namespace {

using namespace codec_bench;

struct Case {
  std::string group, name;
  bool shipped = false;
  double bits = 0, ideal = 0;  ///< a scalar
  double scalars = 0;
  double table_bytes = -1;
  double encode_seconds = 1e9, decode_seconds = 1e9;
  std::function<double()> encode = {}, decode = {};  ///< seconds

  [[nodiscard]] double encode_rate() const { return scalars / encode_seconds * 1e-6; }
  [[nodiscard]] double decode_rate() const { return scalars / decode_seconds * 1e-6; }
  [[nodiscard]] double excess() const { return bits - ideal; }
};

[[noreturn]] void stop(const std::string& why) {
  std::fprintf(stderr, "accuracy_vs_time_codec: %s\n", why.c_str());
  std::exit(1);
}

template <class Body>
double processor_seconds(const Body& body) {
  const auto now = [] {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  };
  const double start = now();
  body();
  return now() - start;
}
template <class Body>
double wall_seconds(const Body& body) {
  const auto start = std::chrono::steady_clock::now();
  body();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// A coder of this program.
template <class Model>
Case any_case(std::string group, std::string name, const SymbolSet& set, Model made) {
  Case one{std::move(group), std::move(name)};
  const auto model = std::make_shared<Model>(std::move(made));
  const auto coded = std::make_shared<Coded>();
  const auto out = std::make_shared<std::vector<std::int32_t>>(set.size());
  encode_any(*model, set.value, *coded);
  decode_any(*model, *coded, *out);
  if (*out != set.value) stop(one.name + " does not decode to what went in");
  one.ideal = set.ideal;
  one.scalars = static_cast<double>(set.size());
  one.bits = coded->bits() / one.scalars;
  one.table_bytes = static_cast<double>(model->bytes());
  one.encode = [=, &set] { return processor_seconds([&] { encode_any(*model, set.value, *coded); }); };
  one.decode = [=] { return processor_seconds([&] { decode_any(*model, *coded, *out); }); };
  return one;
}

/// The library's, in chunks of so many symbols.
Case shipped_case(const SymbolSet& set, const GaussianTables& tables, std::size_t chunk) {
  struct Memory {
    std::vector<std::uint8_t> bytes;
    std::vector<std::size_t> ends{0};
    std::vector<std::int32_t> out;
  };
  const auto memory = std::make_shared<Memory>();
  memory->out.resize(set.size());
  const auto part = [&set, chunk](auto& values, std::size_t first) {
    return std::span(values).subspan(first, std::min(chunk, set.size() - first));
  };
  const auto encode = [=, &set, &tables] {
    memory->bytes.clear();
    memory->ends.resize(1);
    for (std::size_t i = 0; i < set.size(); i += chunk) {
      encode_symbols(tables, part(set.models, i), part(set.value, i), memory->bytes);
      memory->ends.push_back(memory->bytes.size());
    }
  };
  const auto decode = [=, &set, &tables] {
    for (std::size_t c = 0; c + 1 < memory->ends.size(); ++c) {
      const auto bytes =
          std::span<const std::uint8_t>(memory->bytes).subspan(memory->ends[c], memory->ends[c + 1] - memory->ends[c]);
      if (!decode_symbols(tables, part(set.models, c * chunk), bytes, part(memory->out, c * chunk)))
        stop("a chunk does not decode");
    }
  };
  encode();
  decode();
  if (memory->out != set.value) stop("the shipped coder does not decode to what went in");
  Case one{"chunk",
           chunk >= set.size() ? "shipped, one chunk" : "shipped, " + std::to_string(chunk) + " symbols a chunk"};
  one.shipped = chunk >= set.size();
  one.ideal = set.ideal;
  one.scalars = static_cast<double>(set.size());
  one.bits = 8 * static_cast<double>(memory->bytes.size()) / one.scalars;
  one.table_bytes = 0.27e6;
  one.encode = [=] { return processor_seconds(encode); };
  one.decode = [=] { return processor_seconds(decode); };
  return one;
}

/// Anchors with a unmasked offset: those that are coded.
CodecModel unmasked_anchors(const CodecModel& model) {
  CodecModel unmasked = model;
  unmasked.voxels.clear(), unmasked.mask.clear(), unmasked.feature.clear(), unmasked.scale.clear(),
      unmasked.offset.clear();
  const auto copy = [](const std::vector<float>& from, std::vector<float>& to, std::size_t row, std::size_t width) {
    const auto begin = from.begin() + static_cast<std::ptrdiff_t>(row * width);
    to.insert(to.end(), begin, begin + static_cast<std::ptrdiff_t>(width));
  };
  for (std::size_t i = 0; i < model.anchors(); ++i) {
    if (model.mask[i] == 0) continue;
    unmasked.voxels.push_back(model.voxels[i]);
    unmasked.mask.push_back(model.mask[i]);
    copy(model.feature, unmasked.feature, i, static_cast<std::size_t>(model.feature_dim));
    copy(model.scale, unmasked.scale, i, 6);
    copy(model.offset, unmasked.offset, i, 3 * static_cast<std::size_t>(model.offset_count));
  }
  return unmasked;
}

/// A whole file: everything but the search for the bits of weights.
Case file_case(std::string group, std::string name, const CodecModel& model, std::optional<WeightBits> bits,
               std::size_t threads) {
  Case one{std::move(group), std::move(name)};
  const auto executor = std::make_shared<ThreadExecutor>(threads);
  const auto encoded = encode_hac(model, {bits}, *executor);
  if (!encoded) stop(encoded.error().line());
  const auto bytes = std::make_shared<std::vector<std::byte>>(encoded->bytes);
  const CodecReport& report = encoded->report;
  one.scalars = static_cast<double>(report.symbols[0] + report.symbols[1] + report.symbols[2]);
  one.ideal = (report.ideal_bits[0] + report.ideal_bits[1] + report.ideal_bits[2]) / one.scalars;
  one.bits =
      8 * static_cast<double>(report.bytes_of(HacFormat::stream) + report.bytes_of(HacFormat::digests)) / one.scalars;
  const auto seconds = [threads](const auto& body) {
    return threads == 1 ? processor_seconds(body) : wall_seconds(body);
  };
  one.encode = [=, &model] { return seconds([&] { (void)encode_hac(model, {bits}, *executor).ok(); }); };
  one.decode = [=] {
    return seconds([&] {
      const auto decoded = decode_hac(*bytes, "", {}, *executor);
      if (!decoded || !decoded->verified) stop("a file does not decode");
    });
  };
  return one;
}

/// Files whose context network has weights of so many bits; symbols and steps are those of the finest, so that only the
/// prediction differs.
std::vector<Case> network_cases(const CodecModel& model, const GaussianTables& tables, std::size_t threads) {
  CodecModel unmasked = unmasked_anchors(model);
  ThreadExecutor executor(threads);
  std::vector<ContextEvaluator::Steps> steps;
  std::vector<Case> cases;
  const auto bits_of = [&](const IntegerContext& context) {
    const IntegerNetwork::Packed packed = context.network.pack();
    detail::HacPredictor predictor(context, packed, unmasked.voxels);
    return detail::sample_bits({context.heads, tables, model.base_step, model.offset_count},
                               detail::chunk_rows(unmasked, 0, unmasked.anchors()), predictor, steps);
  };
  const auto context_of = [&](int bits) {
    Result<IntegerContext> context = detail::context_of(model, WeightBits::all(bits));
    if (!context) stop(context.error().line());
    return std::move(*context);
  };
  const double finest = bits_of(context_of(16));
  const auto add = [&](const std::string& name, const IntegerContext& context, std::optional<WeightBits> bits,
                       bool shipped) {
    Case one = file_case("weights", name, model, bits, 1);
    const auto bytes = static_cast<double>(encode_context_network(context.network).size());
    one.bits = (bits_of(context) + 8 * bytes) / one.scalars;
    one.ideal = finest / one.scalars;
    one.table_bytes = bytes;
    one.shipped = shipped;
    cases.push_back(std::move(one));
  };
  for (const int bits : {5, 6, 8, 10, 12, 14, 16})
    add(std::to_string(bits) + " bits a weight", context_of(bits), WeightBits::all(bits), false);
  const Result<IntegerContext> chosen = detail::choose_context(model, unmasked, tables, std::nullopt, executor);
  if (!chosen) stop(chosen.error().line());
  add("bits by part, as chosen", *chosen, std::nullopt, true);
  return cases;
}

CodecModel read_codec_model(const std::filesystem::path& path) {
  const Result<LoadedModel<recipes::HacScaffold>> loaded = read_model<recipes::HacScaffold>(path);
  if (!loaded) stop(loaded.error().line());
  Result<CodecModel> coded = coded_model<recipes::HacScaffold>(loaded->model, loaded->info);
  if (!coded) stop(coded.error().line());
  return std::move(*coded);
}

struct Options {
  std::filesystem::path model, json, html, svg;
  std::size_t symbols = std::size_t{1} << 20, anchors = 20'000;
  int repetitions = 5;
};

std::optional<Options> parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    const auto value = [&]() -> const char* { return i + 1 < argc ? argv[++i] : ""; };
    if (argument == "--symbols") {
      options.symbols = std::max(4096ul, std::strtoul(value(), nullptr, 10));
    } else if (argument == "--anchors") {
      options.anchors = std::max(64ul, std::strtoul(value(), nullptr, 10));
    } else if (argument == "--repetitions") {
      options.repetitions = std::max(1, std::atoi(value()));
    } else if (argument == "--json") {
      options.json = value();
    } else if (argument == "--html") {
      options.html = value();
    } else if (argument == "--svg") {
      options.svg = value();
    } else if (argument.substr(0, 2) == "--" || !options.model.empty()) {
      std::fprintf(stderr,
                   "usage: accuracy_vs_time_codec [MODEL.safetensors] [--symbols N] [--anchors N] [--repetitions N] "
                   "[--json FILE] [--html FILE] [--svg FILE]\n");
      return std::nullopt;
    } else {
      options.model = argument;
    }
  }
  return options;
}

/// Short enough to stand beside a point: the number that is turned. Three groups share the point of the full grid,
/// which is named once.
std::string plot_label(const Case& one) {
  if (one.group == "erfc") return one.name.find("float") == std::string::npos ? "" : "erfc, float and double";
  if (one.name == "16 bits") return "16 bits, 8, 1/32";
  if (one.name == "8 deviations an octave" || one.name == "to 1/32 bin") return "";
  const std::size_t first = one.name.find_first_of("0123456789");
  if (first == std::string::npos) return one.name;
  if (one.group == "precision") return one.name.substr(first, 7);
  const std::string number = one.name.substr(first, one.name.find(' ', first) - first);
  return one.group == "mean" ? number + " bin" : one.group == "deviation" ? number + " an octave" : number;
}

std::vector<tool::Plot> plots_of(const std::vector<Case>& cases) {
  tool::Plot symbols{.title = "Bits above ideal against speed of decoding, symbols alone",
                     .x_label = "million symbols a second, one core",
                     .y_label = "bits a scalar above ideal",
                     .series = {},
                     .log_x = true,
                     .log_y = true,
                     .width = 860,
                     .height = 520};
  tool::Plot weights{.title = "Bits of the context network's weights",
                     .x_label = "bytes of the network",
                     .y_label = "bits a scalar above ideal, network included",
                     .series = {},
                     .log_x = true,
                     .width = 860,
                     .height = 320};
  // What is cheaper than its Gaussian, as trained symbols are, has no place on a logarithmic axis.
  symbols.log_y = std::none_of(cases.begin(), cases.end(), [](const Case& one) { return one.excess() <= 0; });
  int color = 0;
  for (const char* group : {"precision", "deviation", "mean", "erfc", "chunk", "floor", "weights"}) {
    tool::PlotSeries series{
        .label = group, .points = {}, .names = {}, .color = color++ % 6, .line = true, .dots = true};
    tool::Plot& plot = std::string_view(group) == "weights" ? weights : symbols;
    series.line = std::string_view(group) != "erfc";
    for (const Case& one : cases) {
      if (one.group != group) continue;
      const bool file = &plot == &weights;
      if (file && one.shipped) continue;
      series.points.push_back({file ? one.table_bytes : one.decode_rate(), one.excess()});
      series.names.push_back(plot_label(one));
    }
    plot.series.push_back(std::move(series));
  }
  return {symbols, weights};
}

}  // namespace

int main(int argc, char** argv) {
  const std::optional<Options> options = parse(argc, argv);
  if (!options) return 2;
  const GaussianTables tables;
  const bool trained = !options->model.empty();
  CodecModel model =
      trained ? read_codec_model(options->model)
              : compmark::testing::make_codec_model(1, compmark::testing::full_codec_model(options->anchors));
  SymbolSet set;
  if (trained) {
    const Result<IntegerContext> finest = detail::context_of(model, WeightBits::all(16));
    if (!finest) stop(finest.error().line());
    set = model_symbols(unmasked_anchors(model), *finest, options->symbols);
  } else {
    set = synthetic_symbols(options->symbols);
  }
  set.value.resize(set.size() / 4 * 4);  // whole rounds of the four states
  set.mean.resize(set.size()), set.sigma.resize(set.size()), set.models.resize(set.size());
  set.finish();

  std::vector<Case> cases;
  cases.push_back(any_case("precision", "12 bits a frequency", set, GridModel<12>(set, 8, 32)));
  cases.push_back(any_case("precision", "14 bits", set, GridModel<14>(set, 8, 32)));
  cases.push_back(any_case("precision", "16 bits", set, GridModel<16>(set, 8, 32)));
  cases.push_back(any_case("precision", "18 bits", set, GridModel<18>(set, 8, 32)));
  cases.push_back(any_case("precision", "20 bits", set, GridModel<20>(set, 8, 32)));
  for (const int levels : {1, 2, 4, 8, 16}) {
    const std::string name = std::to_string(levels) + (levels == 1 ? " deviation an octave" : " deviations an octave");
    cases.push_back(any_case("deviation", name, set, GridModel<16>(set, levels, 32)));
  }
  for (const int phases : {1, 2, 4, 8, 16, 32}) {
    cases.push_back(any_case("mean", phases == 1 ? "mean to 1 bin" : "to 1/" + std::to_string(phases) + " bin", set,
                             GridModel<16>(set, 8, phases)));
  }
  for (const int floor : {4, 16, 64}) {
    cases.push_back(
        any_case("floor", "least frequency " + std::to_string(floor), set, GridModel<16>(set, 8, 32, floor)));
  }
  cases.push_back(any_case("erfc", "erfc in float, no tables", set, ErfcModel<float>(set)));
  cases.push_back(any_case("erfc", "erfc in double, no tables", set, ErfcModel<double>(set)));
  for (std::size_t chunk = 512; chunk < set.size() && chunk <= 262144; chunk *= 8)
    cases.push_back(shipped_case(set, tables, chunk));
  cases.push_back(shipped_case(set, tables, set.size()));

  const std::size_t cores = ThreadExecutor(0).concurrency();
  for (Case& one : network_cases(model, tables, cores)) cases.push_back(std::move(one));
  std::vector<CodecModel> chunked;
  for (const int anchors : {256, 1024, 4096, 16384}) {
    chunked.push_back(model);
    chunked.back().chunk_anchors = anchors;
  }
  for (const CodecModel& one : chunked) {
    cases.push_back(
        file_case("file chunk", std::to_string(one.chunk_anchors) + " anchors a chunk", one, WeightBits{}, cores));
    cases.back().shipped = one.chunk_anchors == CodecModel{}.chunk_anchors;
  }
  for (std::size_t threads = 1; threads <= cores; threads *= 2)
    cases.push_back(file_case("threads", std::to_string(threads) + (threads == 1 ? " thread" : " threads"), model,
                              WeightBits{}, threads));

  for (int repetition = 0; repetition < options->repetitions; ++repetition) {
    for (Case& one : cases) {
      one.encode_seconds = std::min(one.encode_seconds, one.encode());
      one.decode_seconds = std::min(one.decode_seconds, one.decode());
    }
  }

  const std::string head = tool::format_text(
      "%s: %zu symbols of %.4f bits (ideal); whole files of %zu anchors; best of %d repetitions, interleaved",
      trained ? options->model.filename().c_str() : "Gaussian symbols, deviations 0.3 to 8 bins", set.size(), set.ideal,
      model.anchors(), options->repetitions);
  const std::string note =
      "Groups precision to chunk code symbols whose Gaussians are given, on one thread, in processor time, with all "
      "other knobs at 16 bits, 8 "
      "deviations an octave and means to 1/32 bin; weights, file chunk and threads are whole files with the context, "
      "the octree and all checks, "
      "by wall clock where there are more threads than one. Ideal: the Gaussians in long double; of weights, the "
      "16-bit network free of charge, at its steps; "
      "of files, what the tables "
      "say. KB: tables, or the network in the file. A star marks what is shipped.";
  tool::Table table{{"case", "group", "bits a scalar", "excess bits", "excess %", "encode M/s", "decode M/s", "KB", ""},
                    {}};
  nlohmann::ordered_json json{{"schema", 1},
                              {"model", options->model.filename().string()},
                              {"symbols", set.size()},
                              {"ideal", set.ideal},
                              {"anchors", model.anchors()},
                              {"repetitions", options->repetitions},
                              {"cases", nlohmann::ordered_json::array()}};
  for (const Case& one : cases) {
    table.rows.push_back(
        {one.name, one.group, tool::format_text("%.4f", one.bits), tool::format_text("%+.4f", one.excess()),
         tool::format_text("%+.2f", 100 * one.excess() / one.ideal), tool::format_text("%.1f", one.encode_rate()),
         tool::format_text("%.1f", one.decode_rate()),
         one.table_bytes < 0 ? "" : tool::format_text("%.1f", one.table_bytes / 1e3), one.shipped ? "*" : ""});
    json["cases"].push_back({{"name", one.name},
                             {"group", one.group},
                             {"shipped", one.shipped},
                             {"bits", one.bits},
                             {"ideal", one.ideal},
                             {"scalars", one.scalars},
                             {"encode_mega_per_s", one.encode_rate()},
                             {"decode_mega_per_s", one.decode_rate()},
                             {"bytes", one.table_bytes}});
  }
  std::printf("%s\n\n%s\n%s\n", head.c_str(), table.markdown().c_str(), note.c_str());
  if (!options->json.empty()) {
    if (const Result<Done> written = write_json(options->json, json); !written) stop(written.error().line());
  }
  const std::vector<tool::Plot> plots = plots_of(cases);
  const std::string page = tool::html_page("Accuracy against time: coding", head, plots, note, table);
  if (const Result<Done> written = tool::write_pages(options->html, options->svg, page, {plots[0]}); !written)
    stop(written.error().line());
  return 0;
}
