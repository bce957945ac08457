// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the recipe of the tool's closed list that models the effects of a capture.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/pipeline/model_file.hpp>
#include <compmark/scene/dataset.hpp>
#include <compmark/scene/probe.hpp>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// The recorded effect of a model whose lens was treated as a pinhole.
inline constexpr const char* lens_ignored = "lens_ignored";

struct EffectChoice {
  std::string recipe;
  std::vector<std::string> simulated;  ///< effects that the recipe and the readers model
  std::vector<std::string> left_out;   ///< measured, but in no recipe of the list together with those
};

/// The recipe with the most of these effects and none besides (a principal point, a constant background and
/// forward-facing cameras need none); with LensTreatment::keep it is one that projects through the lens, if the effects
/// name one.
EffectChoice choose_recipe(const std::vector<std::string>& effects, compmark::LensTreatment lens);

/// True for the recipes that project through a lens.
bool projects_lens(std::string_view recipe);
/// Settings to open the dataset of a model: its lens as in training.
compmark::DatasetSettings settings_of(const compmark::ModelInfo& info);
/// Opens a dataset and moves it to where the model lies (ModelInfo::origin).
compmark::Result<compmark::Dataset> open_for(const compmark::ModelInfo& info, const std::filesystem::path& data,
                                             const compmark::DatasetSettings& settings);
/// A view of a dataset as a model stores it.
compmark::StoredView stored_view(const compmark::View& view);

/// Effects by name, from --effects ("auto": those that were measured, "none", or a list with commas).
compmark::Result<std::vector<std::string>> wanted_effects(const std::string& option,
                                                          const std::vector<compmark::ProbedEffect>& probed);

}  // namespace tool
