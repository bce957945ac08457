// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit: an unmarked model and the cameras it was trained on in; a message decoder for this scene out (pipeline/decoder_fit.hpp), and a JSON of
// what it found. The decoder reads no message yet: embed hides one for it.
#include <algorithm>
#include <chrono>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/mark/lattice_file.hpp>
#include <compmark/pipeline/decoder_fit.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "commands.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "evaluation.hpp"
#include "model_source.hpp"
#include "reading.hpp"
#include "recipe_list.hpp"

namespace tool {
namespace {

using namespace compmark;
using Host = recipes::Scaffold;

struct FitOptions {
  std::filesystem::path model, data, out, json;
  DecoderFitSettings fit;
  double downscale = 1;
  std::size_t threads = 0;
};

Result<Done> check(FitOptions& options) {
  const auto refuse = [](const char* option, const std::string& problem, const char* remedy) {
    return Error{ErrorKind::invalid, {}, option, problem, remedy};
  };
  if (options.json.empty()) options.json = std::filesystem::path(options.out).replace_extension(".json");
  if (options.json == options.out) return refuse("--out", "is the name of the JSON file too", "name it .safetensors");
  if (options.fit.waves == 0) options.fit.waves = std::max(64, 20 * options.fit.bits / 3);  // 320 for 48 bits
  if (options.fit.waves < options.fit.bits)
    return refuse("--waves", "is less than --bits", "give more waves than bits, or leave it out");
  if (options.fit.statistics_views == 0) options.fit.statistics_views = 4 * options.fit.waves;
  if (options.fit.statistics_views < options.fit.waves)
    return refuse("--views", "is less than --waves", "give some four times as many, or leave it out");
  return keep_inputs(options.out, {options.model}, "--out");
}

int run(FitOptions& options) {
  if (Result<Done> good = check(options); !good) return fail(good.error());
  const Result<ModelSource> source = ModelSource::open(options.model, options.threads);
  if (!source) return fail(source.error());
  if (reading_recipe(source->recipe) != "scaffold") {
    return fail({ErrorKind::unsupported, options.model.string(), "recipe",
                 "\"" + source->recipe + "\" is not one that a message is hidden in",
                 "a model of scaffold, scaffold+mask or scaffold+alpha"});
  }
  Result<LoadedModel<Host>> loaded = source->load<Host>();
  if (!loaded) return fail(loaded.error());
  DatasetSettings settings = settings_of(loaded->info);
  settings.downscale = options.downscale;
  Result<Dataset> dataset = open_for(loaded->info, options.data, settings);
  if (!dataset) return fail(dataset.error());
  for (const std::string& warning : dataset->warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  const DatasetViews views{&*dataset, nullptr, dataset->indices(Split::train)};  // cameras alone: no photograph is read
  ThreadExecutor executor(options.threads);
  const auto begin = std::chrono::steady_clock::now();
  std::fprintf(stderr, "compmark: %d waves in %d drawn views, their gradients in %d\n", options.fit.waves,
               options.fit.statistics_views, options.fit.gradient_views);
  const Result<DecoderFit<float>> fit = fit_decoder(loaded->model, views, options.fit, executor);
  if (!fit) return fail(fit.error());
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  const Result<std::string> model = file_sha256(options.model);
  if (!model) return fail(model.error());
  const std::string note = "fitted to the unmarked model of sha256 " + *model;
  if (Result<Done> written = write_lattice<SafetensorsWriter>(fit->decoder, note, options.out); !written)
    return fail(written.error());
  const Result<std::string> decoder = file_sha256(options.out);
  if (!decoder) return fail(decoder.error());
  const nlohmann::ordered_json json{{"schema", "compmark.fit.1"},
                                    {"bits", options.fit.bits},
                                    {"waves", options.fit.waves},
                                    {"seed", options.fit.seed},
                                    {"statistics_views", options.fit.statistics_views},
                                    {"gradient_views", options.fit.gradient_views},
                                    {"wave_deviation", fit->wave_deviation},
                                    {"wave_agreement", fit->wave_agreement},
                                    {"agreement", fit->agreement},
                                    {"noise_ratio", fit->noise_ratio},
                                    {"seconds", seconds},
                                    {"threads", executor.concurrency()},
                                    {"model_sha256", *model},
                                    {"decoder_sha256", *decoder}};
  if (Result<Done> written = write_file(options.json, json.dump(2) + "\n"); !written) return fail(written.error());
  std::printf("decoder %s\nsha256 %s\n", options.out.string().c_str(), decoder->c_str());
  std::printf("agreement between views %.3f (a wave alone %.3f), noise %.2g of a wave's, %.1f s\n", fit->agreement,
              fit->wave_agreement, fit->noise_ratio, seconds);
  return success;
}

}  // namespace

Command add_fit(CLI::App& app) {
  auto options = std::make_shared<FitOptions>();
  options->fit.waves = options->fit.statistics_views = 0;  // by the bits
  app.add_option("--model", options->model, "the unmarked model (model.safetensors of a training)")->required();
  app.add_option("--data", options->data, "the dataset it was trained on; its cameras alone are used")->required();
  app.add_option("--out", options->out, "decoder file to write (safetensors); keep it with the key")->required();
  app.add_option("--bits", options->fit.bits, "length of the message")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  app.add_option("--waves", options->fit.waves, "to choose from (default: 20 for 3 bits)")->check(CLI::Range(1, 1024));
  app.add_option("--views", options->fit.statistics_views,
                 "drawn views that say what the scene says (default: four a wave)")
      ->check(CLI::Range(1, 100000));
  app.add_option("--gradient-views", options->fit.gradient_views, "drawn views that say what a mark can move")
      ->capture_default_str()
      ->check(CLI::Range(2, 1000));
  app.add_option("--downscale", options->downscale, "divide the images' size by this; as in the training")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 64.0));
  app.add_option("--seed", options->fit.seed, "seed of waves, views and rotation")->capture_default_str();
  app.add_option("--threads", options->threads, "0: all; the result is the same for any number")->capture_default_str();
  app.add_option("--json", options->json, "what was found (default: --out with the ending .json)");
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
