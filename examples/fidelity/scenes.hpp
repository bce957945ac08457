// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The scenes that words of a command line name. What reads datasets is compiled once for the programs that run cells,
// in scenes.cpp.
#pragma once

#include <string>
#include <vector>

#include "cell.hpp"
#include "compmark/core/result.hpp"

namespace fidelity {

/// The scenes of a command line, each of a name of its own, as results are told apart by it. A word names one (a
/// folder, SCENE@2 at half its size), or all that are in a folder; what is none is named on stderr.
[[nodiscard]] Result<std::vector<Scene>> scenes_of(const char* program, const std::vector<std::string>& words);

}  // namespace fidelity
