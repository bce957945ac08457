// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Options that a program passes on to the tool: which of them change the results, and which a codec knows.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace fidelity {

/// The words for `compmark train` but for those that make no other results: when a checkpoint is written and how many
/// images are kept.
[[nodiscard]] inline std::vector<std::string> words_that_count(const std::vector<std::string>& words) {
  std::vector<std::string> count;
  bool value_of_none = false;
  for (const std::string& word : words) {
    const std::string name = word.substr(0, word.find('='));
    const bool none = name == "--checkpoint-every" || name == "--memory-budget";
    if (!none && !value_of_none) count.push_back(word);
    value_of_none = none && name == word;
  }
  return count;
}

/// The words that a codec knows: --calibrate-steps is of context_gs alone.
[[nodiscard]] inline std::vector<std::string> words_for(const std::string& codec,
                                                        const std::vector<std::string>& words) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool unknown = codec != "context_gs" && words[i].rfind("--calibrate-steps", 0) == 0;
    if (!unknown) known.push_back(words[i]);
    if (unknown && words[i].find('=') == std::string::npos) ++i;  // its value
  }
  return known;
}

}  // namespace fidelity
