// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The file of a codec that codes what was trained for another one. Apart from the step that calls it, as the measurement
// is.
#pragma once

#include "cell.hpp"
#include "compmark/core/result.hpp"

namespace fidelity {

/// Writes `folder`/model.cmk, of the model in `trained`, a finished training of the same settings for
/// compmark::trained_codec(cell.codec), and `folder`/results.json: those of the training with the bytes, sections and
/// times of this file. Its qualities are those of the training's file, of which it must decode to the same model.
/// Error: the training has no such file, or decodes to another model.
[[nodiscard]] Result<Done> code_trained(const Cell& cell, const Settings& settings, const fs::path& trained,
                                        const fs::path& folder);

}  // namespace fidelity
