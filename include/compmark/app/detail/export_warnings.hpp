// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What an exported file cannot say of its model, in sentences.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <type_traits>
#include <vector>

#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/codec/rate/stages/rate.hpp"
#include "compmark/core/absent.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/number_text.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/splat/export/explicit_splats.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/model_info.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark::detail {

/// Whether models of the recipe are drawn with the mip filter.
template <class R>
[[nodiscard]] constexpr bool draws_filtered() {
  if constexpr (requires { typename R::Rasterizer::EffectPolicy::Filter; }) {
    return R::Rasterizer::EffectPolicy::Filter::active;
  } else {
    return false;
  }
}

/// Whether a file of the format can say so.
[[nodiscard]] inline bool tells_filter(SplatFormat format) {
  return format == SplatFormat::compressed_ply || format == SplatFormat::spz || format == SplatFormat::sog;
}

/// What anchors in a file show that a render does not: the offsets that a codec's masks leave out. Empty where all show.
template <class R>
std::string masked_offsets_warning(const Model<R>& model) {
  if constexpr (present<typename R::EntropyModel>) {
    const MatrixView<const float> mask = model.arena.values(model.template blocks<RateStage>().mask);
    const auto masked =
        std::count_if(mask.data, mask.data + mask.size(), [](float stored) { return !is_unmasked(stored); });
    if (masked != 0)
      return std::to_string(masked) + " of " + std::to_string(mask.size()) +
             " offsets are not rendered, because the codec's masks leave them out, but the file has no place for "
             "masks: "
             "whoever decodes its anchors draws them";
  }
  return {};
}

/// Properties of the model that the file cannot hold, one sentence each: viewers will show something else. `told`: the
/// file says that the model was trained with the mip filter.
template <class R>
std::vector<std::string> export_warnings(const Model<R>& model, const ModelInfo& info, bool told) {
  std::vector<std::string> warnings;
  const auto number = [](double x) { return short_number(x, 6); };
  const auto exact = [](double x) { return exact_text(x); };  // the export is put back by it
  if (draws_filtered<R>()) {
    warnings.push_back("the model was trained with the mip filter (a blur of " + number(model.render.blur_variance) +
                       " pixels^2 that keeps the energy of a splat), " +
                       (told ? "which the file says, but not every viewer reads" : "but the file cannot say so") +
                       ". Viewers that blur every splat by 0.3 pixels^2 without keeping its energy draw small and "
                       "distant splats too large and too bright: SIBR and antimatter15/splat always do, "
                       "gsplat, SuperSplat and Brush do unless their antialiased or mip mode is on");
  } else if (model.render.blur_variance != 0.3) {
    warnings.push_back("the model was trained with a blur of " + number(model.render.blur_variance) +
                       " pixels^2, but viewers use 0.3");
  }
  if constexpr (!std::is_same_v<RecipeLens<R>, PinholeLens>) {
    warnings.push_back(
        "the model was trained through a lens, but viewers have none: the export is fitted "
        "and measured without distortion");
  }
  if (info.origin != std::array<double, 3>{0, 0, 0}) {
    warnings.push_back("positions are relative to (" + exact(info.origin[0]) + ", " + exact(info.origin[1]) + ", " +
                       exact(info.origin[2]) + ") of the dataset's coordinates, which single precision cannot hold");
  }
  if constexpr (!ExplicitModelRecipe<R>) {
    if (!info.views.empty() && std::all_of(info.views.begin(), info.views.end(), [](const auto& v) { return v.test; }))
      warnings.push_back(
          "the file stores no training camera: colours are fitted over its test views; "
          "the model.safetensors of its run stores them");
  }
  return warnings;
}

}  // namespace compmark::detail
