// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The fit of a decoder to a model of one recipe: the part of fit_decoder.hpp that is compiled for each.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/capture.hpp"
#include "compmark/app/compress.hpp"
#include "compmark/app/dataset_views.hpp"
#include "compmark/app/model_source.hpp"
#include "compmark/app/run/detail/in_file.hpp"
#include "compmark/app/run/fit_decoder.hpp"
#include "compmark/app/run/jpeg_codec.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/context_gs.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/scene/open.hpp"
#include "compmark/splat/training/checkpoint.hpp"
#include "compmark/watermark/fit/decoder_fit.hpp"

namespace compmark::detail {

struct FitProgress {
  RunObserver* observer;
  bool on_progress(std::size_t done, std::size_t total) const { return observer->on_fit(done, total); }
};

/// Settles settings.fit.stride. `views_of_model`: those that the model was trained on, where it does not store them itself.
template <class R>
Result<DecoderFit<float>> fit_model(const ModelSource& source, DecoderFileSettings& settings, ThreadExecutor& executor,
                                    RunObserver& observer, std::vector<StoredView> views_of_model = {}) {
  Result<LoadedModel<R>> loaded = source.load<R>();
  if (!loaded) return loaded.error();
  if (!views_of_model.empty()) loaded->info.views = std::move(views_of_model);
  DatasetSettings data_settings = settings_of(loaded->info);
  data_settings.downscale = settings.downscale;
  data_settings.splat_up = settings.splat_up;
  Result<Dataset> dataset = open_for(loaded->info, settings.data, data_settings, executor);
  if (!dataset) return dataset.error();
  for (const std::string& warning : dataset->warnings) observer.on_warning(warning);
  std::vector<StoredView> now;
  for (const View& view : dataset->views) now.push_back(stored_view(view));
  const std::optional<OtherView> other =
      now.size() == loaded->info.views.size() ? other_view(loaded->info.views, now) : std::nullopt;
  if (!source.splats && (now.size() != loaded->info.views.size() || other)) {
    return Error{ErrorKind::invalid, settings.model.string(), other ? other->field : "views",
                 other ? "of view " + other->name + " is another one in the data" : "are not those of the data",
                 "give the data that it was trained on, as large as then (--downscale)"};
  }
  const DatasetViews views{&*dataset, nullptr, dataset->indices(Split::train)};  // cameras alone: no photograph is read
  if (settings.fit.stride == 0) {  // of the largest view: as many positions as 500 x 500 pixels have
    double pixels = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const Camera<double> camera = views.camera(i);
      pixels = std::max(pixels, static_cast<double>(camera.width) * static_cast<double>(camera.height));
    }
    settings.fit.stride = std::clamp(static_cast<int>(std::lround(std::sqrt(pixels) / 500)), 1, 64);
  }
  observer.on_note(std::to_string(settings.fit.features) + " Fourier features in " +
                   std::to_string(settings.fit.statistics_views) + " sampled novel views, their gradients in " +
                   std::to_string(settings.fit.gradient_views));
  return fit_decoder(loaded->model, views, settings.fit, executor, FitProgress{&observer}, JpegCodec{});
}

/// A decoder for a model that was trained for compression is fitted to the model as its file holds it: rounding alone
/// moves the readings of a decoder for the unrounded model by more than a mark may
/// (docs/notebook/watermark_experiments.md).
template <class R>
Result<DecoderFit<float>> fit_coded_model(ModelSource source, DecoderFileSettings& settings, ThreadExecutor& executor,
                                          RunObserver& observer) {
  std::vector<StoredView> views;
  if (!source.coded) {
    Result<LoadedModel<R>> loaded = source.load<R>();
    if (!loaded) return loaded.error();
    const auto& arena = loaded->model.arena;
    const std::vector<float> statistics =
        coded_floats(arena.values(loaded->model.template blocks<RateStage>().statistics));
    if (!check_statistics(statistics)) return fit_model<R>(source, settings, executor, observer);  // decompressed
    CodedModelSettings coding;
    coding.cameras = StoredCameras::none;  // a file of thousands would be refused, and this one is never written
    const Result<CodecModel> coded = coded_model(loaded->model, loaded->info, coding);
    if (!coded) return in_file(coded.error(), source.path);
    Result<CodecEncoded> file = encode_model(*coded, executor);
    if (!file) return in_file(file.error(), source.path);
    source.coded = std::move(file->model);
    views = std::move(loaded->info.views);
  }
  return fit_model<R>(source, settings, executor, observer, std::move(views));
}

}  // namespace compmark::detail
