// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The finished model that a run starts from. Explicit Gaussians are read from the splat files of other programs too.
#pragma once

#include <filesystem>

#include "compmark/app/model_source.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/export/explicit_splats.hpp"
#include "compmark/splat/training/model_file.hpp"

namespace compmark::detail {

template <class Source>
[[nodiscard]] Result<LoadedModel<Source>> read_source(const std::filesystem::path& path, ThreadExecutor& executor) {
  if constexpr (ExplicitModelRecipe<Source>) {
    const Result<ModelSource> source = ModelSource::open(path, executor);
    if (!source) return source.error();
    return source->template load<Source>();
  } else {
    return read_model<Source>(path);
  }
}

}  // namespace compmark::detail
