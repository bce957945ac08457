// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A picture as a mirror shows it.
#pragma once

#include <algorithm>

#include "compmark/core/views.hpp"

namespace compmark {

/// Turns every row of every plane round, in place. Twice is nothing.
template <class T>
void mirror_rows(ImageView<T> image) {
  for (int c = 0; c < image.channels; ++c) {
    for (int y = 0; y < image.height; ++y) std::reverse(image.row(c, y), image.row(c, y) + image.width);
  }
}

}  // namespace compmark
