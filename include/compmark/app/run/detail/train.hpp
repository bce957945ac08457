// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/train.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "compmark/app/reading.hpp"
#include "compmark/app/run/detail/embed.hpp"
#include "compmark/app/run/detail/in_file.hpp"
#include "compmark/app/run/detail/train_codec.hpp"
#include "compmark/app/run/train.hpp"
#include "compmark/io/file_exists.hpp"

namespace compmark {
namespace detail {

/// Trains the unmarked model in a folder of its own, then hides the message in it by post-hoc embedding. Without a
/// decoder one is fitted in between. The unmarked model is kept.
[[nodiscard]] inline Result<RunOutcome> train_then_mark(RunPlan plan, const TrainSettings& settings,
                                                        std::int64_t mark_iterations) {
  RunObserver& observer = *plan.observer;
  take_universal(plan.mark);
  // All options are checked before hours of work.
  const Result<OwnerKey> key = key_of(plan.mark, warnings_of(observer));
  if (!key) return key.error();
  if (!plan.mark.decoder.empty()) {  // they must agree: a key may be bound to another decoder, or have other bits
    const Result<FileDecoder> opened = open_decoder(plan.mark.decoder, &*key);
    if (!opened) return opened.error();
  }
  const bool coded = is_coded_recipe(plan.recipe);
  if (Result<Done> can = can_mark_finished(plan); !can) return can.error();
  if (Result<Done> apt = check_held(plan.mark, plan.mark.fidelity.value_or(1)); !apt) return apt.error();
  if (Result<Done> fits = check_to_fit(plan.mark); !fits) return fits.error();
  Result<std::shared_ptr<const void>> held = hold_folder(plan.out);
  if (!held) return held.error();
  plan.folder = std::move(*held);
  const std::filesystem::path checkpoint = plan.out / "checkpoint.safetensors";
  if (!plan.resume && detail::file_exists(checkpoint)) return unfinished_run(checkpoint);
  if (Result<Done> goes_on = check_resumes_mark(plan, *key, plan.out / unmarked_folder); !goes_on)
    return goes_on.error();
  const std::filesystem::path decoder = plan.out / "decoder.safetensors";
  const bool fits = plan.mark.decoder.empty();
  if (fits && !plan.resume && !plan.force && detail::file_exists(decoder)) {
    return Error{ErrorKind::invalid, decoder.string(), "--out", "holds the decoder of an earlier run",
                 "to keep it, choose another --out; to continue, give --resume; to move it aside, give"
                 " --force"};
  }
  for (const std::filesystem::path& folder : {plan.out, plan.out / unmarked_folder}) {
    if (Result<Done> free = check_unfinished(folder, plan.resume || plan.force); !free) return free.error();
  }
  warn_of_record(plan.mark.key, plan.out, warnings_of(observer));
  if (fits && plan.force && !plan.resume) {
    if (Result<Done> moved = move_decoder_aside(decoder, notes_of(observer)); !moved) return moved.error();
  }
  RunPlan unmarked = plan;
  unmarked.mark = {};
  unmarked.folder.reset();  // its own
  unmarked.out = plan.out / unmarked_folder;
  const Result<RunOutcome> trained =
      coded ? run_any_coded(unmarked, settings, nullptr) : run_any_plain(unmarked, settings);
  if (!trained) return trained.error();
  RunPlan marked = std::move(plan);
  marked.model = unmarked.out / "model.safetensors";
  marked.iterations = mark_iterations;
  marked.notes.clear();
  return embed_plan(std::move(marked), EmbedDistortion::round);
}

/// An error if numbers of a mark are given without the key whose message it would be.
[[nodiscard]] inline Result<Done> check_has_key(const MarkSettings& mark) {
  if (!mark.key.empty()) return Done{};
  for (const auto& [given, name] :
       {std::pair(mark.spread.has_value(), "--spread"), std::pair(mark.by_cost.has_value(), "--sample-by-loss"),
        std::pair(mark.orbit.has_value(), "--orbit"), std::pair(mark.photographs.has_value(), "--photographs"),
        std::pair(mark.fall.has_value(), "--fidelity-fall"), std::pair(mark.edits.has_value(), "--edits"),
        std::pair(mark.lost_anchors.has_value(), "--lost-anchors"),
        std::pair(mark.calibrate_steps.has_value(), "--calibrate-steps"),
        std::pair(mark.fidelity.has_value() && *mark.fidelity > 0, "--fidelity")}) {
    if (given) return Error{ErrorKind::invalid, {}, name, "needs a message to hide", "give --key"};
  }
  return Done{};
}

/// An error if the profile cannot hide a message in this way.
[[nodiscard]] inline Result<Done> check_published_mark(const TrainChoice& chosen) {
  if (is_published_profile(chosen.profile) && chosen.mark.decoder.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 "--profile",
                 "\"" + chosen.profile + "\" hides the message while the scene trains and needs a finished decoder",
                 "give --decoder (one of weights/, or of compmark pretrain), or leave out --profile"};
  }
  if (is_published_profile(chosen.profile) && chosen.mark.fidelity && *chosen.mark.fidelity > 0) {
    return Error{ErrorKind::unsupported,
                 {},
                 "--fidelity",
                 "above 0 is for post-hoc embedding, but profile \"" + chosen.profile +
                     "\" hides the message while the scene trains",
                 "leave out one of the two options"};
  }
  return Done{};
}

/// An error if numbers of post-hoc embedding are given, but the mark trains with the scene.
[[nodiscard]] inline Result<Done> check_mark_while_training(const TrainChoice& chosen) {
  if (chosen.mark.fidelity && *chosen.mark.fidelity > 0) {
    return Error{ErrorKind::unsupported,
                 {},
                 "--fidelity",
                 "above 0 needs a finished model to mark",
                 !chosen.mark.unmarked.empty()
                     ? "leave out --unmarked: this run trains the unmarked model too"
                     : "leave out --for-compression, which is for marks that train with the scene"};
  }
  for (const auto& [given, name] : {std::pair(chosen.mark.by_cost.has_value(), "--sample-by-loss"),
                                    std::pair(chosen.mark.orbit.has_value(), "--orbit"),
                                    std::pair(chosen.mark.photographs.has_value(), "--photographs"),
                                    std::pair(chosen.mark.spread.has_value(), "--spread"),
                                    std::pair(chosen.mark.calibrate_steps.has_value(), "--calibrate-steps")}) {
    if (!given) continue;
    return Error{ErrorKind::unsupported,
                 {},
                 name,
                 "belongs to post-hoc embedding, but this mark trains with the scene",
                 "leave out this option or --decoder, or mark the finished model with compmark embed"};
  }
  return Done{};
}

[[nodiscard]] inline RunPlan plan_of(const TrainChoice& chosen, ThreadExecutor& executor, RunObserver& observer) {
  RunPlan plan;
  static_cast<RunSettings&>(plan) = chosen;
  plan.recipe = chosen.recipe;
  plan.profile = chosen.profile;
  plan.iterations = chosen.iterations;
  plan.lens = chosen.lens;
  plan.voxel_size = chosen.voxel_size;
  plan.simulated = chosen.simulated;
  plan.notes = chosen.notes;
  plan.mark = chosen.mark;
  plan.intra = chosen.intra;
  plan.executor = &executor;
  plan.observer = &observer;
  return plan;
}

}  // namespace detail

COMPMARK_APP_INLINE bool marks_afterwards(const TrainSceneSettings& settings) {
  const bool held = settings.mark.fidelity && *settings.mark.fidelity > 0;
  return (settings.mark.decoder.empty() || held) && !settings.mark.key.empty() && settings.mark.unmarked.empty() &&
         !settings.mark.for_compression;
}

COMPMARK_APP_INLINE Result<RunOutcome> train_scene(const TrainSceneSettings& wanted, ThreadExecutor& executor,
                                                   RunObserver& observer) {
  detail::TrainChoice chosen;
  static_cast<TrainSceneSettings&>(chosen) = wanted;
  if (Result<Done> keyed = detail::check_has_key(chosen.mark); !keyed) return keyed.error();
  if (Result<Done> free = check_unfinished(chosen.out, chosen.resume || chosen.force); !free) return free.error();
  chosen.intra = chosen.codec == "hac_plus";
  const bool coded = chosen.codec != "none" || is_coded_recipe(chosen.recipe);
  if (coded && chosen.profile == "scaffold") chosen.profile = "hac";
  std::optional<TrainSettings> settings = profile_settings(chosen.profile);
  if (!settings) {
    return Error{ErrorKind::invalid,
                 {},
                 "--profile",
                 "unknown profile \"" + chosen.profile + "\"",
                 "choose scaffold, hac, official or paper"};
  }
  Result<CoarseToFine> coarse = coarse_to_fine_of(chosen.coarse_to_fine);
  if (!coarse) return detail::in_option(coarse.error(), "--coarse-to-fine");
  const bool recipe_given = !chosen.recipe.empty();
  if (Result<Done> fits = detail::choose_effects(chosen, executor); !fits) return fits.error();
  if (Result<Done> fits = detail::choose_codec(chosen, recipe_given); !fits) return fits.error();
  if (chosen.mark.wanted() && !recipe_given && !coded) detail::leave_out_unmarked(chosen);
  if (!coded && is_markable_recipe(chosen.recipe) && !can_be_fitted(chosen.recipe))
    chosen.notes.push_back("a model of " + chosen.recipe + " can be marked, but no codec compresses it; " +
                           (projects_lens(chosen.recipe) ? "--lens undistort" : "--for-fit-codec") +
                           " trains one that can be");
  if (coded) {
    if (detail::is_published_profile(chosen.profile)) *settings = for_codec(*settings);
    settings->rate.lambda = chosen.rate_lambda;
  }
  settings->iterations = chosen.iterations;
  settings->coarse_to_fine = std::move(*coarse);
  settings->max_anchors = chosen.max_anchors;
  if (chosen.seed) settings->seed = *chosen.seed;
  if (chosen.voxel_size) settings->voxel_size = *chosen.voxel_size;
  if (chosen.background) {
    settings->background = *chosen.background;
  } else if (chosen.probed_background) {
    for (std::size_t c = 0; c < 3; ++c) settings->background[c] = static_cast<float>((*chosen.probed_background)[c]);
  }
  if (chosen.recipe.find("+antialiasing") != std::string::npos)
    settings->blur_variance = recipes::antialiasing_blur_variance;
  if (detail::is_published_profile(chosen.profile)) detail::take_universal(chosen.mark);
  const detail::RunPlan plan = detail::plan_of(chosen, executor, observer);
  if (chosen.mark.wanted()) {
    if (Result<Done> fits = detail::check_published_mark(chosen); !fits) return fits.error();
    const bool has_layer = !coded && (detail::is_published_profile(chosen.profile) || chosen.mark.for_compression);
    if (Result<Done> fits = detail::check_step_rate(chosen.mark, has_layer); !fits) return fits.error();
    if (marks_afterwards(chosen)) return detail::train_then_mark(plan, *settings, chosen.mark_iterations);
    if (Result<Done> fits = detail::check_mark_while_training(chosen); !fits) return fits.error();
    if (Result<Done> fits = detail::check_to_fit(chosen.mark); !fits) return fits.error();
    const Result<RunMark> mark = detail::load_mark(chosen.mark, *settings, executor, detail::warnings_of(observer));
    if (!mark) return mark.error();
    return coded ? detail::run_any_coded(plan, *settings, &*mark) : detail::run_any_marked(plan, *settings, *mark);
  }
  return coded ? detail::run_any_coded(plan, *settings, nullptr) : detail::run_any_plain(plan, *settings);
}

}  // namespace compmark
