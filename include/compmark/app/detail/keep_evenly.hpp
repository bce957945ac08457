// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Some of many views or pictures.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace compmark::detail {

/// The items a user asked for, evenly spaced: the same ones for everybody. 0: all.
template <class T>
void keep_evenly(std::vector<T>& items, std::size_t count) {
  if (count == 0 || count >= items.size()) return;
  std::vector<T> kept;
  for (std::size_t i = 0; i < count; ++i) kept.push_back(std::move(items[i * items.size() / count]));
  items = std::move(kept);
}

}  // namespace compmark::detail
