// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The figures of a trained cell: what compmark evaluate writes, by the functions behind it.
#pragma once

#include "cell.hpp"
#include "compmark/core/result.hpp"

namespace fidelity {

/// Writes evaluate.json, .csv, .html and .txt of a cell whose models are there.
[[nodiscard]] Result<Done> measure_cell(const Cell& cell, const Settings& settings);

}  // namespace fidelity
