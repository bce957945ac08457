// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/fit_codec.hpp.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "compmark/app/compress.hpp"
#include "compmark/app/files.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/run_loops.hpp"
#include "compmark/app/run/detail/run_mark.hpp"
#include "compmark/app/run/fit_codec.hpp"
#include "compmark/app/run/mark_record.hpp"
#include "compmark/io/safetensors.hpp"

namespace compmark {
namespace detail {

/// Of a finished model: nothing grows, and the rate counts from the first iteration on.
[[nodiscard]] inline TrainSettings codec_settings(TrainSettings settings, bool touch_up, bool exposes) {
  settings.grow_until = 0;
  settings.rate.noise_after = settings.rate.context_after = 0;
  const auto last = [&](LearningRate& rate) {
    rate = touch_up ? LearningRate{rate.final, rate.final} : LearningRate{};
  };
  for (LearningRate* rate : {&settings.offset, &settings.mlp_opacity, &settings.mlp_color}) last(*rate);
  if (exposes) last(settings.effects.exposure);
  // Those that are constant in a training.
  for (LearningRate* rate : {&settings.feature, &settings.scaling, &settings.mlp_covariance})
    *rate = touch_up ? LearningRate{rate->final / 10, rate->final / 100} : LearningRate{};
  return settings;
}

/// The recipe that fits `codec` to models of `recipe`.
[[nodiscard]] inline Result<std::string> fitted_recipe(const std::string& recipe, const std::string& codec,
                                                       const std::filesystem::path& model) {
  if (is_coded_recipe(recipe)) {
    return Error{ErrorKind::invalid, model.string(), "recipe", "\"" + recipe + "\" is already trained for a codec",
                 "write its file with compmark compress"};
  }
  if (!can_be_fitted(recipe)) {
    return Error{
        ErrorKind::unsupported, model.string(), "recipe", "\"" + recipe + "\" cannot be fitted with a codec",
        "use scaffold, alone or with +mask, +alpha, +exposure or +farfield: compmark train --for-fit-codec, and --lens "
        "undistort in place of project; or compmark train --codec"};
  }
  return codec + "+fitted" + (recipe.find("+exposure") != std::string::npos ? "+exposure" : "") +
         (recipe.find("+mask") != std::string::npos ? "+mask" : "");
}

}  // namespace detail

COMPMARK_APP_INLINE Result<RunOutcome> fit_codec(const FitCodecSettings& wanted, ThreadExecutor& executor,
                                                 RunObserver& observer) {
  detail::RunPlan plan;
  static_cast<RunSettings&>(plan) = wanted;
  plan.model = wanted.model;
  plan.mark = wanted.mark;
  plan.profile = "hac";
  plan.intra = wanted.codec == "hac_plus";
  plan.iterations = wanted.iterations;
  plan.executor = &executor;
  plan.observer = &observer;
  if (Result<Done> free = check_unfinished(plan.out, plan.resume || plan.force); !free) return free.error();
  if (is_coded_file(plan.model))
    return Error{ErrorKind::invalid, plan.model.string(), {}, "is compressed already", "copy the file"};
  const Result<std::string> recipe = [&]() -> Result<std::string> {
    const Result<SafetensorsFile> file = read_safetensors(plan.model);
    if (!file) return file.error();
    Result<std::string> of_model = model_recipe(*file);
    return of_model ? detail::fitted_recipe(*of_model, trained_codec(wanted.codec), plan.model) : of_model;
  }();
  if (!recipe) return recipe.error();
  plan.recipe = *recipe;
  const Result<std::string> digest = file_sha256(plan.model);
  if (!digest) return digest.error();
  TrainSettings settings = *profile_settings(plan.profile);
  settings.iterations = plan.iterations;
  if (plan.seed) settings.seed = *plan.seed;
  settings.rate.lambda = wanted.rate_lambda;
  std::optional<RunMark> mark;
  if (plan.mark.wanted()) {
    if (plan.mark.key.empty())
      return Error{ErrorKind::invalid, {}, "--key", "is missing", "give the key that the model was marked with"};
    if (Result<Done> fits = detail::check_to_fit(plan.mark); !fits) return fits.error();
    TrainSettings of_a_mark = settings;  // nothing trains for it
    Result<RunMark> read = detail::load_mark(plan.mark, of_a_mark, executor, detail::warnings_of(observer));
    if (!read) return read.error();
    const Result<Done> recorded =
        check_recorded(plan.mark.key, read->key, plan.mark.decoder, plan.model, detail::warnings_of(observer));
    if (!recorded) observer.on_warning(plan.mark.decoder.string() + ": " + recorded.error().problem);
    mark = std::move(*read);
    mark->read_only = true;
  }
  const bool exposes = plan.recipe.find("+exposure") != std::string::npos;
  settings.mark.identity = digest->substr(0, 16);  // a run is resumed from the same model alone
  return detail::run_any_coded(plan, detail::codec_settings(std::move(settings), wanted.touch_up, exposes),
                               mark ? &*mark : nullptr);
}

}  // namespace compmark
