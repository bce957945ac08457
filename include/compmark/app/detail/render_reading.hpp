// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What app/detail/reading.hpp reads of a model: its renders, less those of the unmarked model where there is one.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/files.hpp"
#include "compmark/app/detail/keep_evenly.hpp"
#include "compmark/app/reading.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/watermark/proof/restored_features.hpp"

namespace compmark::detail {

/// The unmarked model of the scene of `marked`. Both must have the same unit and origin, or a camera of one sees
/// nothing of the other.
inline Result<AnyModel> load_unmarked(const std::filesystem::path& path, const ModelInfo& marked, Reading& reading,
                                      ThreadExecutor& executor) {
  std::string digest;
  Result<AnyModel> model = AnyModel::open(path, executor, &digest);
  if (!model) return model;
  if (model->info().unit != marked.unit || model->info().origin != marked.origin) {
    return Error{ErrorKind::invalid, path.string(), "--unmarked",
                 "has another unit of length or another origin than the model",
                 "give the unmarked model that this one was made from"};
  }
  reading.sources.unmarked = path.filename().string();
  reading.sources.unmarked_sha256 = std::move(digest);
  return model;
}

inline Result<Done> read_renders(const ReadingSettings& settings, const FileDecoder& decoder,
                                 const CoverInterference* interference, ThreadExecutor& executor,
                                 const WorkObserver& observer, Reading& reading) {
  std::string digest;
  Result<AnyModel> model = AnyModel::open(settings.model, executor, &digest);
  if (!model) return model.error();
  reading.sources.model = settings.model.filename().string();
  reading.sources.model_sha256 = std::move(digest);
  std::vector<StoredView> views = model->info().views;
  const bool any_test = std::any_of(views.begin(), views.end(), [](const StoredView& view) { return view.test; });
  if (settings.split != ViewChoice::all) {
    const bool test = settings.split == ViewChoice::test && any_test;
    std::erase_if(views, [&](const StoredView& view) { return view.test != test; });
  }
  if (views.empty()) {
    return Error{ErrorKind::invalid, settings.model.string(), "--split", "the model stores no such camera",
                 "render images of it and give them with --images"};
  }
  keep_evenly(views, settings.views);
  std::optional<AnyModel> unmarked;
  if (!settings.unmarked.empty()) {
    Result<AnyModel> loaded = load_unmarked(settings.unmarked, model->info(), reading, executor);
    if (!loaded) return loaded.error();
    unmarked = std::move(*loaded);
  }
  if (settings.restored) {
    // A second copy, since the first is read as it is.
    std::string again;
    Result<AnyModel> whole = AnyModel::open(settings.unmarked, executor, &again);
    if (!whole) return whole.error();
    if (again != reading.sources.unmarked_sha256) {
      return Error{ErrorKind::invalid, settings.unmarked.string(), "--unmarked", "was changed while it was read",
                   "read it again when nobody writes it"};
    }
    Result<RestoredFeatures> restored = restore_features(whole->arena(), std::as_const(model->arena()), executor);
    if (!restored) return detail::named(restored.error(), settings.model);
    reading.restored = *restored;
    *model = std::move(*whole);
  }
  if (Result<Done> made_up = model->make_up_for(settings.missing_share); !made_up) return made_up;
  FileDecoder::Context context;
  for (const StoredView& view : views) {
    Result<ViewLogits> read = read_render(*model, view, decoder, context, executor, interference);
    if (!read) return read.error();
    if (unmarked) {
      const Result<ViewLogits> said = read_render(*unmarked, view, decoder, context, executor);
      if (!said) return said.error();
      for (std::size_t bit = 0; bit < read->logits.size(); ++bit) read->logits[bit] -= said->logits[bit];
    }
    reading.views.push_back(std::move(*read));
    if (Result<Done> on = tell(observer, reading.views.size(), views.size()); !on) return on;
  }
  return Done{};
}

}  // namespace compmark::detail
