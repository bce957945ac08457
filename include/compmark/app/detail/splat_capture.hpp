// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/splat_capture.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/splat_capture.hpp"
#include "compmark/io/splat/read_splat.hpp"
#include "compmark/io/splat/splat_rounding.hpp"
#include "compmark/math/spherical_harmonics.hpp"
#include "compmark/scene/capture_around.hpp"
#include "compmark/scene/picture_source.hpp"
#include "compmark/scene/resize.hpp"
#include "compmark/scene/views_around.hpp"

namespace compmark {
namespace detail {

/// Renders of a model.
class RenderedPictures final : public PictureSource {
 public:
  RenderedPictures(AnyModel model, ThreadExecutor& executor) : model_(std::move(model)), executor_(&executor) {}

  [[nodiscard]] Result<StoredImage> picture(const View& view, const DecodeSettings& settings) const override {
    if (std::any_of(settings.background.begin(), settings.background.end(), [](float c) { return c != 0; })) {
      return Error{ErrorKind::unsupported, view.image_path.string(), "--background",
                   "is not black, and the pictures of a splat file are drawn over black", "leave the option out"};
    }
    const Result<RenderedView> render = model_.render(view.camera, *executor_);
    if (!render) return render.error();
    StoredImage image{view.camera.width, view.camera.height, {}, {}, {}};
    image.planes.resize(3 * image.plane_size());
    for (std::size_t i = 0; i < image.planes.size(); ++i) {
      const float value = render->image.data[i];
      if (!std::isfinite(value)) {
        return Error{ErrorKind::invalid, view.image_path.string(), view.name,
                     "has a pixel that is not a number, drawn from this camera",
                     "remove splats of enormous size from the file"};
      }
      image.planes[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
    }
    return image;
  }

 private:
  mutable AnyModel model_;  // the buffers of its last render
  ThreadExecutor* executor_;
};

/// Where a training begins: at most 200,000 of the splats that are at least half opaque (of all, where none is).
[[nodiscard]] inline PointCloud points_of_splats(const SplatTable& table) {
  constexpr std::size_t most = 200000;
  const std::vector<std::size_t> rows = opaque_rows(table);
  const std::size_t step = std::max<std::size_t>(1, (rows.size() + most - 1) / most);
  PointCloud points;
  for (std::size_t at = 0; at < rows.size(); at += step) {
    std::array<float, 3>& place = points.position.emplace_back();
    std::array<std::uint8_t, 3>& color = points.color.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) {
      place[c] = table.mean[c][rows[at]];
      const double value = color_of_dc(table.color(c, 0)[rows[at]]);
      color[c] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
    }
  }
  return points;
}

}  // namespace detail

COMPMARK_APP_INLINE Result<Dataset> open_splat_capture(const std::filesystem::path& file,
                                                       const DatasetSettings& settings, ThreadExecutor& executor) {
  if (!(settings.downscale > 0) || !std::isfinite(settings.downscale)) {
    return Error{ErrorKind::invalid, file.string(), "downscale",
                 "must be a positive number, not " + std::to_string(settings.downscale), "use 1, 2, 4 or 8"};
  }
  Result<ModelSource> source = ModelSource::open(file, executor);
  if (!source) return source.error();
  if (!source->splats) {
    return Error{ErrorKind::invalid,
                 file.string(),
                 {},
                 "is no splat file",
                 "give a PLY, compressed PLY, SPZ, SOG, .splat, .ksplat or .glb file"};
  }
  Result<AnyModel> model = AnyModel::load(*source);
  if (!model) return model.error();
  const SplatTable& table = source->splats->table;

  Dataset dataset;
  dataset.kind = "splats";
  dataset.root = file;
  for (const std::string& note : source->splats->notes) dataset.warnings.push_back(file.string() + ": " + note);
  CaptureAround around;
  around.views = splat_views;
  dataset.splat_up = settings.splat_up ? settings.splat_up : source->splats->up;
  around.up = dataset.splat_up.value_or(usual_up);
  around.width = around.height = scaled_size(splat_picture_size, splat_picture_size, settings.downscale, 0).width;
  for (const Camera<double>& camera : capture_around(table, around)) {
    View view;
    const std::string number = std::to_string(dataset.views.size());
    view.name = "around_" + std::string(3 - std::min<std::size_t>(3, number.size()), '0') + number;
    view.image_path = file;
    view.camera = camera;
    view.file_width = camera.width;
    view.file_height = camera.height;
    const auto every = static_cast<std::size_t>(std::max(0, settings.test_every));
    if (every > 0 && dataset.views.size() % every == 0) view.split = Split::test;
    dataset.views.push_back(std::move(view));
  }
  dataset.points = detail::points_of_splats(table);
  dataset.pictures = std::make_shared<const detail::RenderedPictures>(std::move(*model), executor);
  return dataset;
}

}  // namespace compmark
