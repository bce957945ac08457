// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What somebody may have meant by a word that nothing is called.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

/// Letters that have to be put in, left out, replaced or exchanged with their neighbour to make one word of the other
/// (optimal string alignment).
[[nodiscard]] inline std::size_t letters_apart(std::string_view a, std::string_view b) {
  std::array<std::vector<std::size_t>, 3> rows;  // the last two, and this one
  for (std::vector<std::size_t>& row : rows) row.resize(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) rows[2][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::rotate(rows.begin(), rows.begin() + 1, rows.end());
    rows[2][0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t other = a[i - 1] == b[j - 1] ? 0 : 1;
      std::size_t least = std::min({rows[1][j] + 1, rows[2][j - 1] + 1, rows[1][j - 1] + other});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) least = std::min(least, rows[0][j - 2] + 1);
      rows[2][j] = least;
    }
  }
  return rows[2][b.size()];
}

/// The known word that is nearest, the first of several; empty if none is near: more than a third of the letters apart,
/// and more than one.
[[nodiscard]] inline std::string nearest_word(std::string_view word, const std::vector<std::string>& known) {
  std::size_t least = std::max<std::size_t>(1, word.size() / 3) + 1;
  std::string nearest;
  for (const std::string& one : known) {
    const std::size_t apart = letters_apart(word, one);
    if (apart >= least) continue;
    least = apart;
    nearest = one;
  }
  return nearest;
}

}  // namespace tool
