// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/interference.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/files.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/app/interference.hpp"
#include "compmark/core/random.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/scene/novel_view.hpp"
#include "compmark/watermark/decoder/carrier_decoder.hpp"
#include "compmark/watermark/decoder/cover_interference.hpp"
#include "compmark/watermark/fit/cover_interference_fit.hpp"

namespace compmark {
namespace detail {

/// Renders of a model between its cameras. They are not turned or zoomed as novel_view_camera does it: photographs
/// stand upright, and the subject of a picture has one size in a sketch.
class InterferenceViews {
  struct Cameras {
    const std::vector<StoredView>* views;
    [[nodiscard]] const Camera<double>& operator()(std::size_t i) const { return (*views)[i].camera; }
  };

 public:
  InterferenceViews(AnyModel& model, std::vector<StoredView> views, const InterferenceSettings& settings,
                    ThreadExecutor& executor, const WorkObserver& observer)
      : model_(&model),
        views_(std::move(views)),
        settings_(&settings),
        executor_(&executor),
        observer_(&observer),
        clearance_(cameras(), views_.size()) {}

  [[nodiscard]] Result<ImageView<const float>> operator()(std::size_t i) const {
    const Random random(settings_->seed, i, random_stage("cover interference"));
    const std::size_t view = clearance_.view(random.uniform(std::uint64_t{1} << 20));
    const auto neighbour = [&](std::uint64_t draw) {
      return views_[neighbouring_view(cameras(), views_.size(), view, random, draw)].camera;
    };
    const Camera<double> side = camera_between(neighbour(0), neighbour(1), random.uniform(2));
    const Camera<double> camera = camera_between(views_[view].camera, side, random.uniform(3));
    const Result<RenderedView> render = model_->render(camera, views_[view].lens, *executor_);
    if (!render) return render.error();
    round_to_8bit<float>(render->image, render->image);
    if (Result<Done> on = tell(*observer_, i + 1, settings_->views); !on) return on.error();
    return ImageView<const float>(render->image);
  }

 private:
  [[nodiscard]] Cameras cameras() const { return {&views_}; }

  AnyModel* model_;
  std::vector<StoredView> views_;
  const InterferenceSettings* settings_;
  ThreadExecutor* executor_;
  const WorkObserver* observer_;
  ViewClearance clearance_;
};

}  // namespace detail

COMPMARK_APP_INLINE Result<MeasuredInterference> measure_interference(const InterferenceSettings& settings,
                                                                      ThreadExecutor& executor,
                                                                      const WorkObserver& observer) {
  if (settings.views < 2)
    return Error{ErrorKind::invalid, {}, "--views", "is below 2", "give some hundreds of views, or leave it out"};
  const Result<SafetensorsFile> file = read_safetensors(settings.decoder, FileKind::decoder);
  if (!file) return file.error();
  const Result<std::string> digest = file_sha256(settings.decoder);
  if (!digest) return digest.error();
  Result<AnyModel> model = AnyModel::open(settings.model, executor);
  if (!model) return model.error();
  std::vector<StoredView> views = model->info().views;
  std::erase_if(views, [](const StoredView& view) { return view.test; });
  if (views.empty()) {
    return Error{ErrorKind::invalid, settings.model.string(), "--model", "stores no camera of its training",
                 "give the model that train wrote"};
  }
  const detail::InterferenceViews pictures(*model, std::move(views), settings, executor, observer);
  const auto fit_with = [&](const auto& decoder) {
    return fit_cover_interference(decoder, settings.views, pictures, executor);
  };
  const auto fitted = [&]() -> Result<CoverInterferenceFit> {
    const std::size_t dimension = detail::carrier_dimension(*file);
    if (dimension == 0) {
      const Result<FileDecoder> decoder = FileDecoder::read(*file);
      return decoder ? fit_with(*decoder) : decoder.error();
    }
    const Result<DecoderWeights> weights = read_decoder(*file);
    if (!weights) return weights.error();
    std::vector<double> axes(dimension * dimension, 0.0);  // every output by itself, before any key
    for (std::size_t d = 0; d < dimension; ++d) axes[d * (dimension + 1)] = 1;
    const auto decoder = CarrierDecoder<float, WinogradOrDirect>::create(*weights, axes, file->path);
    return decoder ? fit_with(*decoder) : decoder.error();
  };
  Result<CoverInterferenceFit> fit = fitted();
  if (!fit) {
    Error error = fit.error();
    if (error.file.empty() && error.kind != ErrorKind::cancelled) error.file = settings.model.string();
    return error;
  }
  fit->interference.decoder_sha256 = *digest;
  if (Result<Done> written =
          write_cover_interference<SafetensorsWriter>(fit->interference, "what a scene says by itself", settings.out);
      !written)
    return written.error();
  return MeasuredInterference{fit->deviation, fit->told};
}

}  // namespace compmark
