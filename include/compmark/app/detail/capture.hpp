// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/capture.hpp.
#pragma once

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "compmark/app/capture.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/app/splat_capture.hpp"
#include "compmark/io/splat/read_splat.hpp"
#include "compmark/scene/open.hpp"

namespace compmark {

COMPMARK_APP_INLINE DatasetSettings settings_of(const ModelInfo& info) {
  DatasetSettings settings;
  if (projects_lens(info.recipe)) settings.lens = LensTreatment::keep;
  if (std::find(info.effects.begin(), info.effects.end(), lens_ignored) != info.effects.end())
    settings.lens = LensTreatment::ignore;
  return settings;
}

COMPMARK_APP_INLINE StoredView stored_view(const View& view) {
  StoredView stored{view.name, view.split == Split::test, view.camera, {}};
  if (view.lens_treatment == LensTreatment::keep) stored.lens = view.lens;
  return stored;
}

COMPMARK_APP_INLINE Result<Dataset> open_capture(const std::filesystem::path& data, const DatasetSettings& settings,
                                                 ThreadExecutor& executor) {
  std::error_code status;
  if (std::filesystem::is_regular_file(data, status) && is_splat_file(data))
    return open_splat_capture(data, settings, executor);
  return open_dataset(data, settings);
}

COMPMARK_APP_INLINE Result<Dataset> open_for(const ModelInfo& info, const std::filesystem::path& data,
                                             const DatasetSettings& settings, ThreadExecutor& executor) {
  Result<Dataset> dataset = open_capture(data, settings, executor);
  if (!dataset) return dataset.error();
  if (dataset->unit != info.unit) change_unit(*dataset, info.unit);
  if (dataset->origin == info.origin) return dataset;
  // Models from before the origin was stored: their cameras are where this reader moves them.
  for (const StoredView& stored : info.views) {
    for (const View& view : dataset->views) {
      if (view.name == stored.name && view.camera.center_world == stored.camera.center_world) return dataset;
    }
  }
  move_origin(*dataset, info.origin);
  return dataset;
}

}  // namespace compmark
