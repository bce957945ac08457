// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Splits photographs into those a decoder is trained on and those it is measured on, from their names alone. Files that
// differ only in a last _number are pieces of one photograph and stay on one side; the groups whose names hash lowest
// are held out. A card can therefore name the held-out photographs, and a test can find them again. Cost: a sort of the
// names.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"

namespace compmark {

/// "kitchen_0.jpg" and "kitchen_12.jpg" are of "kitchen"; "kitchen.jpg" too, and "0001.jpg" of "0001".
[[nodiscard]] inline std::string photograph_group(std::string_view file_name) {
  const std::string_view stem = file_name.substr(0, file_name.rfind('.'));
  std::size_t end = stem.size();
  while (end > 0 && std::isdigit(static_cast<unsigned char>(stem[end - 1])) != 0) --end;
  return std::string(end > 1 && end < stem.size() && stem[end - 1] == '_' ? stem.substr(0, end - 1) : stem);
}

/// The groups to keep out: that share of them, rounded, at least one.
[[nodiscard]] inline std::set<std::string> held_out_groups(const std::vector<std::string>& file_names, double share) {
  std::set<std::pair<std::uint64_t, std::string>> order;
  for (const std::string& name : file_names) {
    const std::string group = photograph_group(name);
    order.insert({mix_bits(random_stage(group)), group});
  }
  const auto wanted = static_cast<std::size_t>(std::max(1.0, share * static_cast<double>(order.size()) + 0.5));
  std::set<std::string> out;
  for (const auto& [hash, group] : order) {
    if (out.size() < wanted) out.insert(group);
  }
  return out;
}

}  // namespace compmark
