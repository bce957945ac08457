// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The part of fit_run.hpp that is compiled for every recipe that a message is hidden in. Include it where that is done.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <compmark/app/capture.hpp>
#include <compmark/app/dataset_views.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/watermark/fit/decoder_fit.hpp>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "common.hpp"
#include "fit_run.hpp"
#include "jpeg_codec.hpp"
#include "model_files.hpp"
#include "progress.hpp"

namespace tool {

using namespace compmark;  // files that include this one do nothing but fit

/// A figure on a terminal, a line every ten seconds elsewhere.
class FitLine {
 public:
  bool on_progress(std::size_t done, std::size_t total) {
    const double since = std::chrono::duration<double>(Clock::now() - last_).count();
    if (done != total && since < (terminal_ ? 0.2 : 10)) return true;
    last_ = Clock::now();
    const double spent = std::chrono::duration<double>(last_ - start_).count(),
                 left = spent * static_cast<double>(total - done) / static_cast<double>(done);
    std::fprintf(stderr, "%sfit %.0f %%  ETA %s%s", terminal_ ? "\r" : "",
                 100 * static_cast<double>(done) / static_cast<double>(total), format_duration(left).c_str(),
                 !terminal_ || done == total ? "\n" : "\x1b[K");
    return true;  // a signal ends the process: nothing of a fit is kept
  }

 private:
  using Clock = std::chrono::steady_clock;
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

/// Settles options.fit.stride.
template <class R>
Result<DecoderFit<float>> fit_model(const ModelSource& source, FitOptions& options, ThreadExecutor& executor) {
  Result<LoadedModel<R>> loaded = source.load<R>();
  if (!loaded) return loaded.error();
  DatasetSettings settings = settings_of(loaded->info);
  settings.downscale = options.downscale;
  Result<Dataset> dataset = open_for(loaded->info, options.data, settings);
  if (!dataset) return dataset.error();
  for (const std::string& warning : dataset->warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  std::vector<StoredView> now;
  for (const View& view : dataset->views) now.push_back(stored_view(view));
  const std::optional<OtherView> other =
      now.size() == loaded->info.views.size() ? other_view(loaded->info.views, now) : std::nullopt;
  if (now.size() != loaded->info.views.size() || other) {
    return Error{ErrorKind::invalid, options.model.string(), other ? other->field : "views",
                 other ? "of view " + other->name + " is another one in the data" : "are not those of the data",
                 "give the data that it was trained on, as large as then (--downscale)"};
  }
  const DatasetViews views{&*dataset, nullptr, dataset->indices(Split::train)};  // cameras alone: no photograph is read
  if (options.fit.stride == 0) {  // of the largest view: as many positions as 500 x 500 pixels have
    double pixels = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const Camera<double> camera = views.camera(i);
      pixels = std::max(pixels, static_cast<double>(camera.width) * static_cast<double>(camera.height));
    }
    options.fit.stride = std::clamp(static_cast<int>(std::lround(std::sqrt(pixels) / 500)), 1, 64);
  }
  std::fprintf(stderr, "compmark: %d Fourier features in %d sampled novel views, their gradients in %d\n",
               options.fit.waves, options.fit.statistics_views, options.fit.gradient_views);
  return fit_decoder(loaded->model, views, options.fit, executor, FitLine{}, JpegCodec{});
}

/// These are compiled in files of their own. `plain` is a name without the parts that only training needs.
Result<DecoderFit<float>> fit_coded(const std::string& plain, const ModelSource& source, FitOptions& options,
                                    ThreadExecutor& executor);

}  // namespace tool
