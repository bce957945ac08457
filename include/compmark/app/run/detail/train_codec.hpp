// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the recipe of a training that has a codec or a message: effects that it lacks are left out with a note.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/run_loops.hpp"
#include "compmark/app/run/detail/train_effects.hpp"

namespace compmark::detail {

/// Whether the message of this run, if it has one, is hidden in the finished model. Effects of photographs are no
/// matter to it then: it marks renders, and these have no exposure (marking_recipe).
inline bool marks_finished_model(const TrainChoice& chosen) {
  if (!chosen.mark.wanted()) return true;
  return marks_afterwards(chosen) && (!chosen.mark.fidelity || *chosen.mark.fidelity > 0);
}

/// Leaves an effect out of what the model simulates, and says why.
inline void leave_out(TrainChoice& chosen, const char* effect, const std::string& why) {
  if (std::erase(chosen.simulated, effect) != 0)
    chosen.notes.push_back(std::string("effect ") + effect + " is left out: " + why);
}

/// A finished model of every recipe can be marked; but a message that trains together with the scene has three recipes,
/// and a decoder is not fitted to those with anti-aliasing. An effect that is in the way is left out with a note.
inline void leave_out_unmarked(TrainChoice& chosen) {
  if (chosen.recipe.rfind("scaffold+", 0) != 0) return;
  std::string recipe = chosen.recipe;
  if (marks_finished_model(chosen)) {
    const bool fits = chosen.mark.decoder.empty() && chosen.mark.universal.empty();
    if (!fits || recipe.find("+antialiasing") == std::string::npos) return;
    recipe = without_effects(std::move(recipe), {"+antialiasing"});
    leave_out(chosen, "anti_aliasing", "no decoder is fitted to a model that has it; that of the program needs no fit");
  } else {
    const auto names = [&](const char* part) { return chosen.recipe.find(part) != std::string::npos; };
    recipe = std::string("scaffold") + (names("mask") ? "+mask" : names("+alpha") ? "+alpha" : "");
    if (recipe == chosen.recipe) return;
    for (const char* effect : {"exposure", "anti_aliasing", "far_field"})
      leave_out(chosen, effect,
                "no message trains together with it; compmark embed marks finished models that have it");
  }
  chosen.recipe = recipe;
  chosen.notes.push_back("recipe " + recipe);
}

/// From the recipe of the effects to one that trains for the codec, or that one can be fitted to; effects that it lacks
/// are left out with a note.
inline Result<Done> choose_codec(TrainChoice& chosen, bool recipe_given) {
  const bool coded = is_coded_recipe(chosen.recipe);
  if (chosen.codec == "none" && !coded && !chosen.for_fit_codec) return Done{};
  if (chosen.for_fit_codec && (coded || chosen.codec != "none")) {
    return Error{ErrorKind::invalid,
                 {},
                 "--for-fit-codec",
                 "belongs to a model without a codec, but this run trains for one",
                 "leave out one of the two options"};
  }
  if (coded) {
    if (chosen.recipe.find("+fitted") != std::string::npos) {
      return Error{ErrorKind::invalid,
                   {},
                   "--recipe",
                   "\"" + chosen.recipe + "\" is for fitting a codec to a finished model",
                   "use compmark fit-codec"};
    }
    if (chosen.codec != "none" && trained_codec(chosen.codec) != recipe_codec(chosen.recipe)) {
      return Error{ErrorKind::invalid,
                   {},
                   "--codec",
                   "\"" + chosen.codec + "\" is not the codec of recipe " + chosen.recipe,
                   "leave out one of the two options"};
    }
    chosen.codec = recipe_codec(chosen.recipe);
    return Done{};
  }
  const std::string trained = trained_codec(chosen.codec);
  if (!recipe_given && !chosen.for_fit_codec && is_published_profile(chosen.profile)) {
    chosen.recipe = trained;  // its numbers in the codec's own recipe
    chosen.notes.push_back("recipe " + chosen.recipe);
    return Done{};
  }
  if (recipe_given || chosen.recipe.rfind("scaffold", 0) != 0) {
    return Error{ErrorKind::invalid,
                 {},
                 chosen.for_fit_codec ? "--for-fit-codec" : "--codec",
                 (chosen.for_fit_codec ? "" : "\"" + chosen.codec + "\" ") +
                     "has recipes of its own, but the recipe is " + chosen.recipe,
                 "leave out --recipe and --profile"};
  }
  const auto names = [&](const char* part) { return chosen.recipe.find(part) != std::string::npos; };
  const bool alpha = names("+alpha"), mask = !alpha && names("mask"),
             exposure = !alpha && names("+exposure") && marks_finished_model(chosen),
             far_field = chosen.for_fit_codec && names("+farfield");
  chosen.recipe = (chosen.for_fit_codec ? "scaffold" : trained) + (alpha ? "+alpha" : "") +
                  (exposure ? "+exposure" : "") + (mask ? "+mask" : "") + (far_field ? "+farfield" : "");
  for (const auto& [effect, kept] : {std::pair{"alpha", alpha}, std::pair{"masks", mask},
                                     std::pair{"exposure", exposure}, std::pair{"anti_aliasing", false}})
    if (!kept) leave_out(chosen, effect, "no recipe for this run has it");
  if (!far_field)
    leave_out(chosen, "far_field",
              "no model trains for a codec with it; without --codec it is trained, and compmark fit-codec compresses "
              "that model");
  chosen.notes.push_back("recipe " + chosen.recipe);
  return Done{};
}

}  // namespace compmark::detail
