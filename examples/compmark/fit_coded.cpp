// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decoders for models that were trained for compression. They are fitted to the model as its file holds it: rounding
// alone moves the readings of a decoder for the unrounded model by more than a mark may
// (docs/notebook/watermark_experiments.md).
#include <compmark/app/compress.hpp>
#include <compmark/recipes/context_gs.hpp>
#include <compmark/recipes/hac.hpp>
#include <utility>
#include <vector>

#include "fit_model.hpp"

namespace tool {
namespace {

template <class R>
Result<DecoderFit<float>> fit(ModelSource source, FitOptions& options, ThreadExecutor& executor) {
  if (!source.coded) {
    const Result<LoadedModel<R>> loaded = source.load<R>();
    if (!loaded) return loaded.error();
    const auto& arena = loaded->model.arena;
    const std::vector<float> statistics =
        detail::coded_floats(arena.values(loaded->model.template blocks<RateStage>().statistics));
    if (!detail::check_statistics(statistics)) return fit_model<R>(source, options, executor);  // decompressed
    CodedModelSettings settings;
    settings.cameras = StoredCameras::all;
    const Result<CodecModel> coded = coded_model(loaded->model, loaded->info, settings);
    if (!coded) return in_file(coded.error(), source.path);
    Result<CodecEncoded> file = encode_model(*coded, executor);
    if (!file) return in_file(file.error(), source.path);
    source.coded = std::move(file->model);
  }
  return fit_model<R>(source, options, executor);
}

}  // namespace

Result<DecoderFit<float>> fit_coded(const std::string& plain, const ModelSource& source, FitOptions& options,
                                    ThreadExecutor& executor) {
  if (plain == "hac") return fit<recipes::HacScaffold>(source, options, executor);
  if (plain == "hac+fitted") return fit<recipes::HacFitted>(source, options, executor);
  if (plain == "context_gs") return fit<recipes::ContextGsScaffold>(source, options, executor);
  return fit<recipes::ContextGsFitted>(source, options, executor);
}

}  // namespace tool
