// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Models of any shipped recipe that nobody trained: anchors on a grid, random numbers of a trained model's size, three
// cameras. Each shows something from each of them.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/recipe_list.hpp>
#include <compmark/core/absent.hpp>
#include <compmark/core/random.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <cstdint>
#include <string>

#include "support/small_scene.hpp"

namespace compmark::testing {

inline constexpr std::size_t small_anchors = 60, small_views = 3;

/// Cameras 0 and 1 of the training, 2 of the test.
inline ModelInfo small_info(const std::string& recipe) {
  ModelInfo info;
  info.recipe = recipe;
  info.profile = "scaffold";
  info.iterations = 30;
  info.seed = 5;
  if (recipe.find("exposure") != std::string::npos) info.effects = {"exposure"};
  for (std::size_t i = 0; i < small_views; ++i)
    info.views.push_back({"view " + std::to_string(i), i == 2, ring_camera(i, small_views, 40, 32)});
  return info;
}

/// The same, at `times` the size.
inline ModelInfo larger_info(const std::string& recipe, int times) {
  ModelInfo info = small_info(recipe);
  for (StoredView& view : info.views) view.camera = view.camera.resized(40 * times, 32 * times);
  return info;
}

template <class R>
Model<R> small_model(std::uint64_t seed = 5, std::size_t anchors = small_anchors) {
  Model<R> model;
  model.create(anchors, small_views);
  model.voxel_size = 0.0625;
  model.render.background = {0.25, 0.5, 1};
  R::GaussianDecoder::initialise(model.arena, model.decoder, seed);
  const Random random(seed, 0, random_stage("small model"));
  const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
  for (std::size_t i = 0; i < columns.position.size(); ++i)
    columns.position.data[i] = static_cast<float>(std::round(24 * random.uniform(i) - 12) * model.voxel_size);
  for (std::size_t i = 0; i < columns.feature.size(); ++i)
    columns.feature.data[i] = static_cast<float>(random.normal(1000 + i));
  for (std::size_t i = 0; i < columns.offset.size(); ++i)
    columns.offset.data[i] = static_cast<float>(random.normal(50000 + i));
  for (std::size_t i = 0; i < columns.scaling.size(); ++i)
    columns.scaling.data[i] = static_cast<float>(std::log(0.05 + 0.1 * random.uniform(90000 + i)));
  if constexpr (present<typename R::EntropyModel>) {
    using Entropy = typename R::EntropyModel;
    Entropy::initialise(model.arena, model.template blocks<RateStage>(), seed);
    const AnchorColumns<const float> all = model.columns();
    if constexpr (requires {
                    Entropy::begin_context(model.arena, model.template blocks<RateStage>(), all.position, all.feature,
                                           all.scaling, all.offset, model.voxel_size);
                  })
      Entropy::begin_context(model.arena, model.template blocks<RateStage>(), all.position, all.feature, all.scaling,
                             all.offset, model.voxel_size);
    else
      Entropy::begin_context(model.arena, model.template blocks<RateStage>(), all.position, all.feature, all.scaling,
                             all.offset);
  }
  return model;
}

/// The names of with_reading_recipe but for "explicit", whose models come from splat files (splat_model.test.cpp).
inline constexpr const char* read_recipes[] = {"scaffold",
                                               "scaffold+antialiasing",
                                               "scaffold+lens",
                                               "scaffold+fisheye",
                                               "scaffold+exposure",
                                               "scaffold+farfield",
                                               "scaffold+exposure+farfield",
                                               "compmark-host",
                                               "compmark-paper-host",
                                               "hac",
                                               "hac+exposure",
                                               "hac+fitted",
                                               "hac+fitted+exposure",
                                               "context_gs",
                                               "context_gs+exposure",
                                               "context_gs+fitted",
                                               "context_gs+fitted+exposure"};

}  // namespace compmark::testing
