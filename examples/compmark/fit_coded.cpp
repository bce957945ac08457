// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decoders for models that were trained for compression. They are fitted to the model before it is rounded, which is what a mark is held to.
#include <compmark/recipes/context_gs.hpp>
#include <compmark/recipes/hac.hpp>

#include "fit_model.hpp"

namespace tool {

Result<DecoderFit<float>> fit_coded(const std::string& plain, const ModelSource& source, FitOptions& options,
                                    ThreadExecutor& executor) {
  return plain == "hac" ? fit_model<recipes::HacScaffold>(source, options, executor)
                        : fit_model<recipes::ContextGsScaffold>(source, options, executor);
}

}  // namespace tool
