// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Options that have another name than they had.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace tool {

/// The words of a command, with the names of options that are called otherwise since. `told(before, now)` is called for
/// each.
template <class Told>
[[nodiscard]] std::vector<std::string> renamed(std::vector<std::string> words, bool of_pretrain, Told&& told) {
  constexpr std::array<std::array<const char*, 2>, 4> names{{{"--twin", "--unmarked"},
                                                             {"--waves", "--features"},
                                                             {"--hold-steps", "--calibrate-steps"},
                                                             {"--draw-by-cost", "--sample-by-loss"}}};
  for (std::string& word : words) {
    for (const auto& [before, now] : names) {
      const std::string old(before);
      if (word != old && word.rfind(old + "=", 0) != 0) continue;
      const std::string name = of_pretrain && old == "--waves" ? "--fourier" : now;
      told(old, name);
      word = name + word.substr(old.size());
      break;
    }
  }
  return words;
}
[[nodiscard]] inline std::vector<std::string> renamed(std::vector<std::string> words) {
  return renamed(std::move(words), false, [](const std::string&, const std::string&) {});
}

}  // namespace tool
