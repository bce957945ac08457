// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The image codec that changes nothing, for the tests that train or measure decoders.
#pragma once

#include <cstddef>

#include "compmark/core/views.hpp"

namespace compmark::testing {

struct NoCodec {
  void operator()(ImageView<const float> image, int /*quality*/, ImageView<float> output) const {
    for (std::size_t i = 0; i < image.size(); ++i) output.data[i] = image.data[i];
  }
};

}  // namespace compmark::testing
