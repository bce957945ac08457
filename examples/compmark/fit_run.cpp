// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "fit_run.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/mark/lattice_file.hpp>
#include <compmark/pipeline/checkpoint.hpp>
#include <compmark/pipeline/decoder_fit.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "evaluation.hpp"
#include "jpeg_codec.hpp"
#include "model_source.hpp"
#include "progress.hpp"
#include "reading.hpp"
#include "recipe_list.hpp"

namespace tool {
namespace {

using namespace compmark;
using Host = recipes::Scaffold;

Result<Done> check(FitOptions& options) {
  const auto refuse = [](const char* option, const std::string& problem, const char* remedy) {
    return Error{ErrorKind::invalid, {}, option, problem, remedy};
  };
  if (options.json.empty()) options.json = std::filesystem::path(options.out).replace_extension(".json");
  if (options.json == options.out) return refuse("--out", "is the name of the JSON file too", "name it .safetensors");
  if (options.fit.waves == 0) options.fit.waves = std::max(64, 20 * options.fit.bits / 3);  // 320 for 48 bits
  if (options.fit.waves < options.fit.bits)
    return refuse("--waves", "is less than --bits", "give more waves than bits, or leave it out");
  if (options.fit.coordinates < 0)
    options.fit.coordinates = std::min(2 * options.fit.waves / 5, options.fit.waves - options.fit.bits);
  if (options.fit.coordinates > options.fit.waves - options.fit.bits)
    return refuse("--coordinates", "leaves fewer waves than --bits", "give fewer, or more --waves");
  if (options.fit.edit_weight == 0) options.fit.edits_per_view = 0;  // nothing to read them for
  if (options.fit.statistics_views == 0) options.fit.statistics_views = 8 * options.fit.waves;
  if (options.fit.statistics_views < options.fit.waves)
    return refuse("--views", "is less than --waves", "give some eight times as many, or leave it out");
  if (Result<Done> kept = keep_inputs(options.out, {options.model, options.json}, "--out"); !kept) return kept;
  return keep_inputs(options.json, {options.model}, "--json");
}

/// A figure on a terminal, a line every ten seconds elsewhere.
class FitLine {
 public:
  void on_progress(std::size_t done, std::size_t total) {
    const double since = std::chrono::duration<double>(Clock::now() - last_).count();
    if (done != total && since < (terminal_ ? 0.2 : 10)) return;
    last_ = Clock::now();
    const double spent = std::chrono::duration<double>(last_ - start_).count(),
                 left = spent * static_cast<double>(total - done) / static_cast<double>(done);
    std::fprintf(stderr, "%sfit %.0f %%  ETA %s%s", terminal_ ? "\r" : "",
                 100 * static_cast<double>(done) / static_cast<double>(total), format_duration(left).c_str(),
                 !terminal_ || done == total ? "\n" : "\x1b[K");
  }

 private:
  using Clock = std::chrono::steady_clock;
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

}  // namespace

Result<FittedFile> fit_to_file(FitOptions options) {
  if (Result<Done> good = check(options); !good) return good.error();
  const Result<ModelSource> source = ModelSource::open(options.model, options.threads);
  if (!source) return source.error();
  if (reading_recipe(source->recipe) != "scaffold") {
    return Error{ErrorKind::unsupported, options.model.string(), "recipe",
                 "\"" + source->recipe + "\" is not one that a message is hidden in",
                 "a model of scaffold, scaffold+mask or scaffold+alpha"};
  }
  Result<LoadedModel<Host>> loaded = source->load<Host>();
  if (!loaded) return loaded.error();
  DatasetSettings settings = settings_of(loaded->info);
  settings.downscale = options.downscale;
  Result<Dataset> dataset = open_for(loaded->info, options.data, settings);
  if (!dataset) return dataset.error();
  for (const std::string& warning : dataset->warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  std::vector<StoredView> now;
  for (const View& view : dataset->views) now.push_back(stored_view(view));
  const std::optional<OtherView> other =
      now.size() == loaded->info.views.size() ? other_view(loaded->info.views, now) : std::nullopt;
  if (now.size() != loaded->info.views.size() || other) {
    return Error{ErrorKind::invalid, options.model.string(), other ? other->field : "views",
                 other ? "of view " + other->name + " is another one in the data" : "are not those of the data",
                 "give the data that it was trained on, as large as then (--downscale)"};
  }
  const DatasetViews views{&*dataset, nullptr, dataset->indices(Split::train)};  // cameras alone: no photograph is read
  if (options.fit.stride == 0) {  // of the largest view: as many positions as 500 x 500 pixels have
    double pixels = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const Camera<double> camera = views.camera(i);
      pixels = std::max(pixels, static_cast<double>(camera.width) * static_cast<double>(camera.height));
    }
    options.fit.stride = std::clamp(static_cast<int>(std::lround(std::sqrt(pixels) / 500)), 1, 64);
  }
  ThreadExecutor executor(options.threads);
  const auto begin = std::chrono::steady_clock::now();
  std::fprintf(stderr, "compmark: %d waves in %d drawn views, their gradients in %d\n", options.fit.waves,
               options.fit.statistics_views, options.fit.gradient_views);
  const Result<DecoderFit<float>> fit =
      fit_decoder(loaded->model, views, options.fit, executor, FitLine{}, JpegCodec{});
  if (!fit) return fit.error();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  const Result<std::string> model = file_sha256(options.model);
  if (!model) return model.error();
  const DecoderFitSettings& f = options.fit;
  const std::string note = "fitted to the unmarked model of sha256 " + *model + " with seed " + std::to_string(f.seed) +
                           ", views " + std::to_string(f.statistics_views) + ", gradient views " +
                           std::to_string(f.gradient_views);
  if (Result<Done> written = write_lattice<SafetensorsWriter>(fit->decoder, note, options.out); !written)
    return written.error();
  const Result<std::string> decoder = file_sha256(options.out);
  if (!decoder) return decoder.error();
  const nlohmann::ordered_json json{{"schema", "compmark.fit.1"},
                                    {"bits", options.fit.bits},
                                    {"waves", options.fit.waves},
                                    {"seed", options.fit.seed},
                                    {"statistics_views", options.fit.statistics_views},
                                    {"gradient_views", options.fit.gradient_views},
                                    {"coordinates", options.fit.coordinates},
                                    {"stride", options.fit.stride},
                                    {"edits_per_view", options.fit.edits_per_view},
                                    {"edit_weight", options.fit.edit_weight},
                                    {"wave_deviation", fit->wave_deviation},
                                    {"wave_agreement", fit->wave_agreement},
                                    {"agreement", fit->agreement},
                                    {"noise_ratio", fit->noise_ratio},
                                    {"seconds", seconds},
                                    {"threads", executor.concurrency()},
                                    {"model_sha256", *model},
                                    {"decoder_sha256", *decoder}};
  if (Result<Done> written = write_file(options.json, json.dump(2) + "\n"); !written) return written.error();
  return FittedFile{*decoder, fit->wave_agreement, fit->agreement, fit->noise_ratio, seconds};
}

}  // namespace tool
