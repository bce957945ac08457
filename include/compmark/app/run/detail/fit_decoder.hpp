// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/fit_decoder.hpp.
#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "compmark/app/files.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/fit_model.hpp"
#include "compmark/app/run/detail/fit_record.hpp"
#include "compmark/app/run/detail/told.hpp"
#include "compmark/app/run/fit_decoder.hpp"
#include "compmark/app/run/run_folder.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/recipes/context_gs.hpp"
#include "compmark/recipes/explicit.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"

namespace compmark {
namespace detail {

/// Settles the numbers that are to be chosen.
inline Result<Done> settle_fit(DecoderFileSettings& settings) {
  const auto refuse = [](const char* option, const std::string& problem, const char* remedy) {
    return Error{ErrorKind::invalid, {}, option, problem, remedy};
  };
  if (settings.json.empty()) settings.json = std::filesystem::path(settings.out).replace_extension(".json");
  if (settings.fit.features == 0) settings.fit.features = std::max(64, 20 * settings.fit.bits / 3);  // 320 for 48 bits
  if (settings.fit.features < settings.fit.bits)
    return refuse("--features", "is less than --bits",
                  "give at least as many features as bits, or leave the option out");
  if (settings.fit.coordinates < 0)
    settings.fit.coordinates = std::min(2 * settings.fit.features / 5, settings.fit.features - settings.fit.bits);
  if (settings.fit.coordinates > settings.fit.features - settings.fit.bits)
    return refuse("--coordinates", "leaves fewer features than --bits", "give fewer coordinates, or more --features");
  if (settings.fit.edit_weight == 0) settings.fit.edits_per_view = 0;  // nothing to read them for
  if (settings.fit.statistics_views == 0) settings.fit.statistics_views = 8 * settings.fit.features;
  if (settings.fit.statistics_views < settings.fit.features)
    return refuse("--views", "is less than --features",
                  "give about eight views for each feature, or leave the option out");
  return Done{};
}

inline Result<DecoderFit<float>> fit_any_model(const std::string& recipe, const ModelSource& source,
                                               DecoderFileSettings& settings, ThreadExecutor& executor,
                                               RunObserver& observer) {
  const std::string plain = marking_recipe(reading_recipe(recipe));
  if (plain == "scaffold") return fit_model<recipes::Scaffold>(source, settings, executor, observer);
  if (plain == "explicit") return fit_model<recipes::Explicit>(source, settings, executor, observer);
  if (plain == "hac") return fit_coded_model<recipes::HacScaffold>(source, settings, executor, observer);
  if (plain == "hac+fitted") return fit_coded_model<recipes::HacFitted>(source, settings, executor, observer);
  if (plain == "context_gs") return fit_coded_model<recipes::ContextGsScaffold>(source, settings, executor, observer);
  return fit_coded_model<recipes::ContextGsFitted>(source, settings, executor, observer);
}

}  // namespace detail

COMPMARK_APP_INLINE Result<FittedDecoder> fit_decoder_file(DecoderFileSettings settings, ThreadExecutor& executor,
                                                           RunObserver& observer) {
  if (Result<Done> good = detail::settle_fit(settings); !good) return good.error();
  if (Result<Done> free = check_no_decoder(settings.out, settings.force); !free) return free.error();
  const Result<std::shared_ptr<const void>> held = hold_file(settings.out);
  if (!held) return held.error();
  if (Result<Done> free = check_no_decoder(settings.out, settings.force); !free)
    return free.error();  // one may have ended
  const Result<ModelSource> source = ModelSource::open(settings.model, executor);
  if (!source) return source.error();
  if (!is_fittable_recipe(source->recipe)) {
    return Error{
        ErrorKind::unsupported, settings.model.string(), "recipe",
        "\"" + source->recipe + "\" has no decoder of its own",
        "hide the message with the decoder of the program (compmark embed without --decoder), or give a model "
        "of scaffold, hac or context_gs, alone or with +mask, +alpha, +exposure or +farfield, of fit-codec, or "
        "a splat file"};
  }
  const double begin = observer.seconds();
  const Result<DecoderFit<float>> fit = detail::fit_any_model(source->recipe, *source, settings, executor, observer);
  if (!fit) return fit.error();
  const double seconds = observer.seconds() - begin;

  const Result<std::string> model = file_sha256(settings.model);
  if (!model) return model.error();
  const std::string note = detail::fit_note(detail::fit_record(*model, settings.fit));
  if (settings.force) {
    if (Result<Done> moved = move_decoder_aside(settings.out, detail::notes_of(observer)); !moved) return moved.error();
  }
  if (Result<Done> written = write_lattice<SafetensorsWriter>(fit->decoder, note, settings.out); !written)
    return written.error();
  const Result<std::string> decoder = file_sha256(settings.out);
  if (!decoder) return decoder.error();
  const nlohmann::ordered_json json{{"schema", "compmark.fit.1"},
                                    {"bits", settings.fit.bits},
                                    {"waves", settings.fit.features},
                                    {"period", settings.fit.period},
                                    {"seed", settings.fit.seed},
                                    {"statistics_views", settings.fit.statistics_views},
                                    {"gradient_views", settings.fit.gradient_views},
                                    {"coordinates", settings.fit.coordinates},
                                    {"stride", settings.fit.stride},
                                    {"edits_per_view", settings.fit.edits_per_view},
                                    {"edit_weight", settings.fit.edit_weight},
                                    {"tone", settings.fit.tone},
                                    {"regions", fit->decoder.settings().regions},
                                    {"region_limit", fit->decoder.settings().region_limit},
                                    {"held_back", fit->held_back},
                                    {"wave_deviation", fit->feature_deviation},
                                    {"wave_agreement", fit->feature_agreement},
                                    {"agreement", fit->agreement},
                                    {"noise_ratio", fit->noise_ratio},
                                    {"seconds", seconds},
                                    {"threads", executor.concurrency()},
                                    {"model_sha256", *model},
                                    {"decoder_sha256", *decoder}};
  if (Result<Done> written = write_file(settings.json, json.dump(2) + "\n"); !written) return written.error();
  return FittedDecoder{*decoder, fit->feature_agreement, fit->agreement, fit->noise_ratio, seconds};
}

}  // namespace compmark
