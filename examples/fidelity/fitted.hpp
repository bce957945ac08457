// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The other way to make a cell: an unmarked model is trained without a codec, one for each scene; then the codec is
// fitted to it, and the mark is hidden in the model of the codec's file. The unmarked model stays the owner's, and both
// codecs share it. Its folder, SCENE_host, belongs to no cell: two commands with one --out at a time would both train
// it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "../compmark/new_names.hpp"
#include "cell.hpp"

namespace fidelity {

/// Options of `compmark train`, by the run that takes them here; some belong to two.
struct DividedWords {
  std::vector<std::string> train;  ///< of the unmarked model's training
  std::vector<std::string> codec;  ///< as compmark fit-codec has them
  std::vector<std::string> mark;   ///< as compmark embed has them
};

/// Names of options that are the mark's alone; each takes a value.
inline constexpr std::array<std::string_view, 13> mark_option_names = {
    "--period",         "--tone",          "--fidelity",        "--fidelity-fall",
    "--sample-by-loss", "--orbit",         "--calibrate-steps", "--message-weight",
    "--message-margin", "--message-power", "--message-rate",    "--message-every",
    "--mark-iterations"};

[[nodiscard]] inline DividedWords divide(const std::vector<std::string>& words) {
  DividedWords divided;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::size_t equals = words[i].find('=');
    const std::string name = words[i].substr(0, equals);
    const bool of_mark = std::find(mark_option_names.begin(), mark_option_names.end(), name) != mark_option_names.end();
    const bool of_all = name == "--seed" || name == "--checkpoint-every";
    std::vector<std::string> taken = {words[i]};
    if ((of_mark || of_all) && equals == std::string::npos && i + 1 < words.size()) taken.push_back(words[++i]);
    if (name == "--mark-iterations") taken[0].erase(2, std::string_view("mark-").size());  // as embed has it
    const auto give = [&](std::vector<std::string>& to) { to.insert(to.end(), taken.begin(), taken.end()); };
    if (of_mark || of_all) give(divided.mark);
    if (!of_mark) give(divided.train);
    if (of_all) give(divided.codec);
  }
  return divided;
}

[[nodiscard]] inline fs::path unmarked_folder(const Cell& cell, const Settings& settings) {
  return settings.out / (cell.scene.name + "_host");
}
/// The settings of the unmarked model.
[[nodiscard]] inline nlohmann::ordered_json unmarked_json(const Cell& cell, const Settings& settings) {
  return {{"schema", "compmark.fidelity-host.1"},
          {"scene", fs::weakly_canonical(cell.scene.folder).string()},
          {"downscale", cell.scene.downscale},
          {"iterations", settings.iterations},
          {"train", words_that_count(divide(tool::renamed(settings.extra)).train)}};
}

}  // namespace fidelity
