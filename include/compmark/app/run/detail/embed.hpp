// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/embed.hpp.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compress.hpp"
#include "compmark/app/files.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/can_mark.hpp"
#include "compmark/app/run/detail/embed_baseline.hpp"
#include "compmark/app/run/detail/embed_decoder.hpp"
#include "compmark/app/run/detail/run_loops.hpp"
#include "compmark/app/run/embed.hpp"
#include "compmark/app/spread.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/number_text.hpp"
#include "compmark/io/splat/read_splat.hpp"
#include "compmark/watermark/baselines/frozen_model.hpp"

namespace compmark {
namespace detail {

/// Settings of a mark in a finished model: only the residual trains. With --fidelity 0 (the published way) everything
/// trains on, at constant small rates and without growing. The message begins with the first iteration. `distortion` is
/// applied to the features of a model for a codec before the message is read; the file is rounded in every case.
[[nodiscard]] inline TrainSettings embed_settings(TrainSettings settings, EmbedDistortion distortion) {
  settings.grow_until = 0;
  settings.mark.message.after = settings.mark.residual.after = 0;
  settings.mark.hsv.after = 0;
  settings.mark.frequency.after = 0;
  if (settings.mark.posthoc.fidelity > 0) {
    settings = with_frozen_model(settings);
    // A model for a codec is read as its file is: rounded from the first iteration on, with a fixed context.
    RateNumbers& rate = settings.rate;
    rate.mask = rate.grid = rate.context = {0, 0};
    rate.hyperprior = 0;
    constexpr std::int64_t always = -60000, never = 60000;  // of 30,000
    rate.noise_after = rate.context_after = distortion == EmbedDistortion::none ? never : always;
    rate.round_after = distortion == EmbedDistortion::round ? always : never;
    settings.mark.distortion.learning_rate = 0;
    return settings;
  }
  const auto last = [](LearningRate& rate) { rate.initial = rate.final; };
  last(settings.offset);
  last(settings.mlp_opacity);
  last(settings.mlp_color);
  settings.mlp_covariance = {settings.mlp_color.final, settings.mlp_color.final};
  settings.scaling = {settings.mark.residual.learning_rate / 10, settings.mark.residual.learning_rate / 100};
  settings.feature = {settings.mark.residual.learning_rate, settings.mark.residual.learning_rate / 10};
  return settings;
}

/// What a codec writes of the unmarked model; an Error if it cannot.
[[nodiscard]] inline Result<CodecModel> coded_unmarked(const RunPlan& plan) {
  Result<AnyModel> model = AnyModel::open(plan.model, *plan.executor);
  if (!model) return model.error();
  Result<CodecModel> coded = model->coded({.intra = plan.intra});
  if (!coded) return in_file(coded.error(), plan.model);
  if (plan.mark.spread) {
    if (const Result<Done> said = store_spread_side(*model, *coded); !said) return in_file(said.error(), plan.model);
  }
  return coded;
}

[[nodiscard]] inline Error no_photographs() {
  return {ErrorKind::invalid,
          {},
          "--data",
          "is missing: only a splat file is marked without the photographs that it was trained on",
          "give the dataset of the model"};
}

/// A file that is there while a run works.
class PassingFile {
 public:
  explicit PassingFile(std::filesystem::path path) : path_(std::move(path)) {}
  PassingFile(const PassingFile&) = delete;
  PassingFile& operator=(const PassingFile&) = delete;
  ~PassingFile() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Writes plan.model with the spread mark of plan.mark to a file in the run's folder; no path where none is wanted. The
/// message is then held to what that renders, so that both marks are in what the run writes. It is made anew by a run
/// that is resumed: the same bytes, in seconds.
[[nodiscard]] inline Result<std::unique_ptr<PassingFile>> spread_before_message(RunPlan& plan) {
  const std::filesystem::path file = plan.out / ".spread.safetensors";
  std::error_code status;
  if (!plan.mark.spread && !std::filesystem::exists(file, status))
    return std::make_unique<PassingFile>(std::filesystem::path());
  if (Result<Done> held = hold_run(plan); !held) return held.error();
  const Result<OwnerKey> key = open_key(plan.mark.key);
  if (!key) return key.error();
  auto made = std::make_unique<PassingFile>(file);
  if (!plan.mark.spread) return made;  // one that a killed run has left goes with this one
  const SpreadMarkSettings settings{plan.model, made->path(), *plan.mark.spread};
  const Result<SpreadMarked> marked = mark_spread(*key, settings, *plan.executor);
  if (!marked) return in_option(marked.error(), "--spread");
  plan.with_spread = made->path();
  plan.notes.push_back("a spread mark of " + fixed_number(marked->psnr, 1) +
                       " dB is hidden first: verify --images PICTURES --unmarked " + plan.model.string() + " reads it");
  return made;
}

/// Hides plan.mark in plan.model.
[[nodiscard]] inline Result<RunOutcome> embed_plan(RunPlan plan, EmbedDistortion distortion) {
  RunObserver& observer = *plan.observer;
  if (Result<Done> free = check_unfinished(plan.out, plan.resume || plan.force); !free) return free.error();
  const bool splats = is_splat_file(plan.model);
  const Result<std::string> recipe = [&]() -> Result<std::string> {
    if (splats) return std::string("explicit");
    const Result<SafetensorsFile> file = read_safetensors(plan.model);
    if (!file) return file.error();
    return model_recipe(*file);
  }();
  if (!recipe) return recipe.error();
  plan.recipe = *recipe;
  if (plan.data.empty()) {
    if (!splats) return no_photographs();
    plan.data = plan.model;  // seen by cameras round it
  }
  if (splats) {
    const Result<SplatFile> file = read_splat(plan.model);
    if (!file) return file.error();
    plan.harmonics = file->table.degree;
  }
  take_universal(plan.mark);
  const bool coded = is_coded_recipe(*recipe);
  const bool fitted = plan.mark.decoder.empty() || fitted_decoder(plan.mark.decoder);
  const bool universal = !fitted && universal_decoder(plan.mark.decoder);
  if (plan.iterations == 0) plan.iterations = coded && !universal ? (fitted ? 4000 : 8000) : 2000;
  const bool baseline = by_baseline(plan);
  if (baseline) {
    if (Result<Done> can = can_mark_by_baseline(plan, distortion == EmbedDistortion::round); !can) return can.error();
  }
  if (Result<Done> can = can_mark_finished(plan); !can) return can.error();
  if (Result<Done> fits = check_to_fit(plan.mark); !fits) return fits.error();
  plan.recipe = marking_recipe(*recipe);
  if (plan.recipe != *recipe)
    plan.notes.push_back(
        "exposures of the photographs stay in the unmarked model: the mark is in renders, and"
        " renders have no exposure");
  if (plan.intra && recipe_codec(*recipe) != std::string_view("hac")) {
    return Error{ErrorKind::invalid, plan.model.string(), "--codec",
                 "is hac_plus, but the model's recipe is " + *recipe + ", which is not trained for hac",
                 "leave the option out, or mark a model of compmark train --codec hac_plus"};
  }
  if (!coded && distortion != EmbedDistortion::round) {
    return Error{ErrorKind::unsupported, plan.model.string(), "--distortion", "works with models for a codec only",
                 "leave the option out, or mark a model of compmark train --codec or fit-codec"};
  }
  std::optional<CodecModel> unmarked;
  if (coded) {
    Result<CodecModel> found = coded_unmarked(plan);
    if (!found) return found.error();
    unmarked = std::move(*found);
  }
  if (plan.mark.decoder.empty()) {
    if (Result<Done> made = make_decoder(plan); !made) return made.error();
  }
  TrainSettings settings = *profile_settings(coded ? "hac" : plan.profile);  // as their training
  settings.iterations = plan.iterations;
  if (plan.seed) settings.seed = *plan.seed;
  const bool own_unmarked = plan.mark.unmarked.empty();
  if (own_unmarked) plan.mark.unmarked = plan.model;
  settings.mark = baseline ? baseline_mark(*plan.method) : posthoc_mark();
  // what each was measured with (docs/notebook/watermark_experiments.md)
  if (!baseline) settings.mark.residual.learning_rate = fitted ? 0.006 : universal ? 0.01 : 0.001;
  if (universal && !baseline) {
    // Photographs give back more decibels than the lower fidelity takes.
    const double photographs = plan.mark.photographs.value_or(sees_photographs(*recipe) ? 0.5 : 0);
    settings.mark.posthoc.photograph_share = photographs;
    settings.mark.posthoc.fidelity = photographs > 0 ? 1200 : 1600;
    settings.mark.posthoc.draw_by_cost = 1;
    settings.mark.posthoc.orbit_share = 0.5;
    settings.mark.message.edited_share = 0.7;
  }
  settings.mark.residual.harmonics = plan.harmonics;
  if (Result<Done> fits = check_step_rate(plan.mark, false); !fits) return fits.error();
  Result<RunMark> mark = load_mark(plan.mark, settings, *plan.executor, warnings_of(observer));
  if (!mark) return mark.error();
  // Rounding changes the file far more than a mark does, and a mark that moves values by whole steps is noise in other
  // views (docs/notebook/watermark_experiments.md).
  if (coded && !universal && !plan.mark.fidelity) settings.mark.posthoc.fidelity = fitted ? 2000 : 600;
  // A mark in ancestors must not make the quantizer steps of their descendants finer
  // (codec/model/step_bias_calibration.hpp).
  if (recipe_codec(*recipe) == std::string_view("context_gs") && distortion != EmbedDistortion::none &&
      !plan.mark.calibrate_steps)
    settings.mark.posthoc.calibrate_steps_every = 50;
  const Result<std::string> digest = file_sha256(plan.model);
  if (!digest) return digest.error();
  settings.mark.identity += digest->substr(0, 16);              // a run is resumed from the same model alone
  if (coded) settings.mark.identity += "networks of the file";  // … and as earlier versions did not train it
  if (baseline) settings.mark.identity += name_of(*plan.method);
  if (plan.mark.spread) settings.mark.identity += "spread " + detail::fixed_number(*plan.mark.spread, 6);
  if (coded && own_unmarked) {
    if (Result<Done> held = hold_run(plan); !held) return held.error();
    const std::filesystem::path checkpoint = plan.out / "checkpoint.safetensors";
    if (!plan.resume && detail::file_exists(checkpoint)) return unfinished_run(checkpoint);
    mark->coded_unmarked = plan.out / "unmarked.cmk";
    // The check of a finished run below comes before anything of it is replaced.
    if (!plan.resume || plan.force || !holds_finished_run(plan.out)) {
      const Result<CodecEncoded> written = write_coded(mark->coded_unmarked, *unmarked, *plan.executor);
      if (!written) return written.error();
    }
  }
  const Result<std::unique_ptr<PassingFile>> with_spread = spread_before_message(plan);
  if (!with_spread) return with_spread.error();
  settings = embed_settings(settings, distortion);
  if (baseline) return run_baseline(plan, settings, *mark);
  return coded ? run_any_coded(plan, settings, &*mark) : run_any_marked(plan, settings, *mark);
}

}  // namespace detail

COMPMARK_APP_INLINE Result<RunOutcome> embed_message(const EmbedSettings& settings, ThreadExecutor& executor,
                                                     RunObserver& observer) {
  detail::RunPlan plan;
  static_cast<RunSettings&>(plan) = settings;
  plan.model = settings.model;
  plan.mark = settings.mark;
  plan.iterations = settings.iterations;
  plan.method = settings.method;
  if (settings.codec != "trained" && settings.codec != "hac_plus") {
    return Error{ErrorKind::invalid,
                 {},
                 "--codec",
                 "\"" + settings.codec + "\" is none that a mark can choose",
                 "give hac_plus for a model that was trained for hac, or trained for the codec of the model"};
  }
  plan.intra = settings.codec == "hac_plus";
  plan.executor = &executor;
  plan.observer = &observer;
  return detail::embed_plan(std::move(plan), settings.distortion);
}

}  // namespace compmark
