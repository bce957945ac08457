// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The figures of a trained cell: what compmark evaluate writes, by the functions behind it. Another tool that was named
// with --compmark measures by itself, since its models are its own.
#pragma once

#include "cell.hpp"
#include "compmark/core/result.hpp"

namespace fidelity {

/// Writes evaluate.json, .csv, .html and .txt of a cell whose models are there. False: it was stopped (process.hpp),
/// and nothing was written.
[[nodiscard]] Result<bool> measure_cell(const Cell& cell, const Settings& settings);

}  // namespace fidelity
