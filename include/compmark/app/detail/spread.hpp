// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/spread.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/files.hpp"
#include "compmark/app/register_places.hpp"
#include "compmark/app/spread.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/watermark/spread/spread_residual.hpp"

namespace compmark {
namespace detail {

/// The training views of a model, evenly spaced, or all it has where it has no others. Of splats that came without
/// cameras, whose file does not say which way is up, some about each of the six axes. It is the model's file alone that
/// says so, never who reads: marking and reading must look from the same places.
inline std::vector<StoredView> spread_views(const ModelInfo& info, std::size_t count) {
  std::vector<StoredView> views;
  for (const StoredView& view : info.views) {
    if (!view.test) views.push_back(view);
  }
  if (views.empty()) views = info.views;
  const std::vector<std::vector<Camera<double>>> groups = register_groups(info);
  if (groups.size() > 1) {
    views.clear();
    for (const std::vector<Camera<double>>& group : groups) {
      for (const Camera<double>& camera : group) views.push_back({{}, false, camera, {}});
    }
  }
  keep_evenly(views, count);
  return views;
}

inline MatrixView<const float> anchor_positions(AnyModel& model) {
  const ParameterArena<float>& arena = model.arena();
  return arena.values(arena.layout().find("anchor.position"));
}

inline MatrixView<float> feature_rows(AnyModel& model) {
  ParameterArena<float>& arena = model.arena();
  return arena.values(arena.layout().find("anchor.feature"));
}

}  // namespace detail

COMPMARK_APP_INLINE Result<double> spread_cell_side(AnyModel& model) {
  const SpreadForm form;
  const std::vector<StoredView> views = detail::spread_views(model.info(), form.views);
  if (views.empty()) {
    return Error{ErrorKind::unsupported, model.file().string(), "camera.table", "the model stores no cameras",
                 "give a trained model"};
  }
  if (model.info().spread_side > 0) return model.info().spread_side;
  const auto camera = [&](std::size_t i) -> const Camera<double>& { return views[i].camera; };
  const double side = spread_side(detail::anchor_positions(model), camera, views.size(), form.cell_pixels);
  if (side > 0) return side;
  return Error{ErrorKind::unsupported, model.file().string(), "anchor.position", "there is no anchor",
               "give a trained model"};
}

COMPMARK_APP_INLINE Result<Done> store_spread_side(AnyModel& unmarked, CodecModel& coded) {
  const Result<double> side = spread_cell_side(unmarked);
  if (!side) return side.error();
  coded.metadata["spread_side"] = *side;
  return Done{};
}

COMPMARK_APP_INLINE Result<SpreadReader> SpreadReader::make(AnyModel& unmarked, ThreadExecutor& executor) {
  const SpreadForm form;
  SpreadReader reader(unmarked);
  const Result<double> side = spread_cell_side(unmarked);
  if (!side) return side.error();
  reader.side_ = *side;
  const std::vector<StoredView> views = detail::spread_views(unmarked.info(), form.views);
  std::vector<float> brightness;
  for (const StoredView& view : views) {
    // Of ITU-R BT.601, as JPEG has it.
    constexpr std::array<float, 3> luma{0.299f, 0.587f, 0.114f};
    const std::size_t plane =
        static_cast<std::size_t>(view.camera.width) * static_cast<std::size_t>(view.camera.height);
    brightness.resize(3 * plane);
    for (std::size_t c = 0; c < 3; ++c)
      std::fill_n(brightness.begin() + static_cast<std::ptrdiff_t>(c * plane), plane, luma[c]);
    const ImageView<const float> d_image{brightness.data(), 3, view.camera.height, view.camera.width};
    const Result<MatrixView<const float>> gradient =
        unmarked.feature_gradient(view.camera, view.lens, d_image, executor);
    if (!gradient) return gradient.error();
    reader.rows_ = gradient->rows;
    reader.columns_ = gradient->columns;
    reader.direction_.resize(gradient->size());
    for (std::size_t i = 0; i < gradient->size(); ++i) reader.direction_[i] += gradient->data[i];
  }
  normalise_rows({reader.direction_.data(), reader.rows_, reader.columns_});
  reader.cells_ = spread_cells(detail::anchor_positions(unmarked), reader.side_);
  if (reader.cells_.place.size() < form.least_cells) {
    return Error{ErrorKind::unsupported, unmarked.file().string(), "anchor.position",
                 "the anchors lie in " + std::to_string(reader.cells_.place.size()) + " cells of " +
                     std::to_string(static_cast<int>(form.cell_pixels)) + " pixels, too few for evidence",
                 "train a model of a larger picture, or hide a message alone"};
  }
  return reader;
}

COMPMARK_APP_INLINE Result<double> SpreadReader::add(ImageView<const float> picture, ImageView<const float> render,
                                                     std::span<const float> weight, const Camera<double>& camera,
                                                     ThreadExecutor& executor, std::span<double> sums) {
  std::vector<float> residual(picture.size());
  const ImageView<float> said{residual.data(), 3, picture.height, picture.width};
  const double blur = spread_residual(picture, render, weight, said);
  const Result<MatrixView<const float>> gradient =
      model_->feature_gradient(camera, Lens{}, ImageView<const float>(said), executor);
  if (!gradient) return gradient.error();
  add_spread_sums(*gradient, direction(), cells_, sums);
  return blur;
}

COMPMARK_APP_INLINE Result<SpreadMarked> mark_spread(const OwnerKey& key, const SpreadMarkSettings& settings,
                                                     ThreadExecutor& executor, const WorkObserver& observer) {
  if (Result<Done> can = check_spread_psnr(settings.psnr, "--psnr"); !can) return can.error();
  Result<AnyModel> model = AnyModel::open(settings.model, executor);
  if (!model) return model.error();
  const Result<SpreadReader> reader = SpreadReader::make(*model, executor);
  if (!reader) return detail::named(reader.error(), settings.model);
  const std::vector<std::int8_t> signs = spread_signs(key, reader->cells());
  const MatrixView<float> feature = detail::feature_rows(*model);
  const std::vector<float> before(feature.data, feature.data + feature.size());
  const std::vector<StoredView> views = detail::spread_views(model->info(), 12);
  std::vector<std::vector<float>> plain;
  for (const StoredView& view : views) {
    const Result<RenderedView> render = model->render(view, executor);
    if (!render) return render.error();
    plain.emplace_back(render->image.data, render->image.data + render->image.size());
  }
  // Small changes of features change pixels in proportion: a few steps of the rule of three.
  constexpr int rounds = 5;
  SpreadMarked marked{0, 0.01, reader->cells().place.size(), reader->cell_side()};
  const double wanted = std::pow(10, -settings.psnr / 10);
  for (int round = 0; round < rounds; ++round) {
    std::copy(before.begin(), before.end(), feature.data);
    add_spread(feature, reader->direction(), reader->cells(), signs, marked.strength);
    double error = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const Result<RenderedView> render = model->render(views[i], executor);
      if (!render) return render.error();
      const ImageView<const float> marked_view(render->image);
      const ImageView<const float> plain_view{plain[i].data(), 3, marked_view.height, marked_view.width};
      error += mean_squared_error(marked_view, plain_view) / static_cast<double>(views.size());
    }
    if (Result<Done> on = detail::tell(observer, static_cast<std::size_t>(round) + 1, rounds); !on) return on.error();
    if (!(error > 0)) {
      return Error{ErrorKind::unsupported, settings.model.string(), "anchor.feature",
                   "no training view changes with the features", "give a trained model"};
    }
    marked.psnr = psnr_from_mse(error);
    if (round + 1 < rounds) marked.strength *= std::sqrt(wanted / error);
  }
  if (Result<Done> written = model->write(settings.out); !written) return written.error();
  return marked;
}

}  // namespace compmark
