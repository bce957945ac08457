// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "fit_run.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <compmark/app/files.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <nlohmann/json.hpp>
#include <utility>

#include <compmark/app/recipe_list.hpp>
#include "fit_model.hpp"
#include "reading.hpp"
#include "run_folder.hpp"

namespace tool {
namespace {

Result<Done> check(FitOptions& options) {
  const auto refuse = [](const char* option, const std::string& problem, const char* remedy) {
    return Error{ErrorKind::invalid, {}, option, problem, remedy};
  };
  if (options.json.empty()) options.json = std::filesystem::path(options.out).replace_extension(".json");
  if (options.fit.waves == 0) options.fit.waves = std::max(64, 20 * options.fit.bits / 3);  // 320 for 48 bits
  if (options.fit.waves < options.fit.bits)
    return refuse("--waves", "is less than --bits", "give at least as many features as bits, or leave the option out");
  if (options.fit.coordinates < 0)
    options.fit.coordinates = std::min(2 * options.fit.waves / 5, options.fit.waves - options.fit.bits);
  if (options.fit.coordinates > options.fit.waves - options.fit.bits)
    return refuse("--coordinates", "leaves fewer features than --bits", "give fewer coordinates, or more --waves");
  if (options.fit.edit_weight == 0) options.fit.edits_per_view = 0;  // nothing to read them for
  if (options.fit.statistics_views == 0) options.fit.statistics_views = 8 * options.fit.waves;
  if (options.fit.statistics_views < options.fit.waves)
    return refuse("--views", "is less than --waves",
                  "give about eight views for each feature, or leave the option out");
  return Done{};
}

}  // namespace

Result<FittedFile> fit_to_file(FitOptions options) {
  if (Result<Done> good = check(options); !good) return good.error();
  if (Result<Done> free = check_no_decoder(options.out, options.force); !free) return free.error();
  const Result<std::shared_ptr<const void>> held = hold_file(options.out);
  if (!held) return held.error();
  if (Result<Done> free = check_no_decoder(options.out, options.force); !free)
    return free.error();  // one may have ended
  const Result<ModelSource> source = open_source(options.model, options.threads);
  if (!source) return source.error();
  if (!is_markable_recipe(source->recipe)) {
    return Error{ErrorKind::unsupported, options.model.string(), "recipe",
                 "\"" + source->recipe + "\" cannot carry a message",
                 "give a model of scaffold, hac or context_gs, alone or with +mask, +alpha or "
                 "+exposure, or of fit-codec"};
  }
  const std::string plain = marking_recipe(reading_recipe(source->recipe));
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  const auto begin = std::chrono::steady_clock::now();
  const Result<DecoderFit<float>> fit = plain == "scaffold" ? fit_model<recipes::Scaffold>(*source, options, executor)
                                                            : fit_coded(plain, *source, options, executor);
  if (!fit) return fit.error();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  const Result<std::string> model = file_sha256(options.model);
  if (!model) return model.error();
  const DecoderFitSettings& f = options.fit;
  const std::string note =
      "fitted to the unmarked model of sha256 " + *model + " with seed " + std::to_string(f.seed) + ", views " +
      std::to_string(f.statistics_views) + ", gradient views " + std::to_string(f.gradient_views) + ", waves " +
      std::to_string(f.waves) + ", period " + nlohmann::json(f.period).dump() + ", coordinates " +
      std::to_string(f.coordinates) + ", stride " + std::to_string(f.stride) + ", edit weight " +
      nlohmann::json(f.edit_weight).dump() + (f.tone > 0 ? ", tone " + nlohmann::json(f.tone).dump() : "") +
      (f.region_limit > 0 ? ", region limit " + nlohmann::json(f.region_limit).dump() : "");
  if (options.force) {
    if (Result<Done> moved = move_decoder_aside(options.out); !moved) return moved.error();
  }
  if (Result<Done> written = write_lattice<SafetensorsWriter>(fit->decoder, note, options.out); !written)
    return written.error();
  const Result<std::string> decoder = file_sha256(options.out);
  if (!decoder) return decoder.error();
  const nlohmann::ordered_json json{{"schema", "compmark.fit.1"},
                                    {"bits", options.fit.bits},
                                    {"waves", options.fit.waves},
                                    {"period", options.fit.period},
                                    {"seed", options.fit.seed},
                                    {"statistics_views", options.fit.statistics_views},
                                    {"gradient_views", options.fit.gradient_views},
                                    {"coordinates", options.fit.coordinates},
                                    {"stride", options.fit.stride},
                                    {"edits_per_view", options.fit.edits_per_view},
                                    {"edit_weight", options.fit.edit_weight},
                                    {"tone", options.fit.tone},
                                    {"regions", fit->decoder.settings().regions},
                                    {"region_limit", fit->decoder.settings().region_limit},
                                    {"held_back", fit->held_back},
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
