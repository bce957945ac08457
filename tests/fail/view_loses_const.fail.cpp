// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A view to const never becomes a view to non-const.
// message: (could not convert|no viable conversion|no matching function|cannot convert)
#include "compmark/core/views.hpp"

void write(compmark::ImageView<float> image);

void read_only(compmark::ImageView<const float> image, compmark::ImageView<float> own) {
#ifdef COMPMARK_MUST_FAIL
  write(image);
#else
  write(own);
  static_cast<void>(image);
#endif
}
