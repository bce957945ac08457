// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the recipe of a training that has a codec or a message: effects that it lacks are left out with a note.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/run_loops.hpp"
#include "compmark/app/run/detail/train_effects.hpp"

namespace compmark::detail {

/// Whether exposures of photographs may train although a message is wanted. No recipe with a message has exposures, but
/// post-hoc embedding marks the renders of a finished model, and these have none (marking_recipe).
inline bool exposes(const TrainChoice& chosen) {
  if (!chosen.mark.wanted()) return true;
  return marks_afterwards(chosen) && (!chosen.mark.fidelity || *chosen.mark.fidelity > 0);
}

/// Three recipes can carry a message; an effect that none of them has is left out with a note.
inline void leave_out_unmarked(TrainChoice& chosen) {
  if (chosen.recipe.rfind("scaffold+", 0) != 0) return;
  const auto names = [&](const char* part) { return chosen.recipe.find(part) != std::string::npos; };
  const bool exposure = names("+exposure") && exposes(chosen);
  const std::string recipe = std::string("scaffold") + (exposure ? "+exposure" : "") +
                             (names("mask")     ? "+mask"
                              : names("+alpha") ? "+alpha"
                                                : "");
  if (recipe == chosen.recipe) return;
  for (const char* effect : {"exposure", "anti_aliasing", "far_field"}) {
    if (exposure && effect == std::string_view("exposure")) continue;
    if (std::erase(chosen.simulated, effect) != 0)
      chosen.notes.push_back(std::string("effect ") + effect + " is left out: no recipe with a message has it");
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
  // Masks before exposure: what a lens left empty must not count.
  const bool alpha = names("+alpha"), mask = !alpha && names("mask"),
             exposure = !alpha && !mask && names("+exposure") && exposes(chosen);
  chosen.recipe = (chosen.for_fit_codec ? "scaffold" : trained) + (alpha      ? "+alpha"
                                                                   : exposure ? "+exposure"
                                                                   : mask     ? "+mask"
                                                                              : "");
  for (const auto& [effect, kept] :
       {std::pair{"alpha", alpha}, std::pair{"masks", mask}, std::pair{"exposure", exposure},
        std::pair{"anti_aliasing", false}, std::pair{"far_field", false}}) {
    if (kept || std::erase(chosen.simulated, effect) == 0) continue;
    chosen.notes.push_back(std::string("effect ") + effect + " is left out: no recipe for this run has it" +
                           (mask && std::string_view(effect) == "exposure"
                                ? " together with a mask. A lens calls for one; colmap image_undistorter takes the "
                                  "lens out (docs/capture.md)"
                                : ""));
  }
  chosen.notes.push_back("recipe " + chosen.recipe);
  return Done{};
}

}  // namespace compmark::detail
