// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model whose features deviate together from what the hash grid predicts, as those of trained scenes do: one number
// an anchor moves them all.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/core/random.hpp"
#include "support/codec_model.hpp"

namespace compmark::testing {

[[nodiscard]] inline CodecModel make_correlated_model(std::uint64_t seed, const CodecModelShape& shape = {},
                                                      double strength = 2) {
  CodecModel model = make_codec_model(seed, shape);
  const Random random(seed, 2, random_stage("correlated model"));
  const auto d = static_cast<std::size_t>(model.feature_dim);
  for (std::size_t i = 0; i < model.anchors(); ++i) {
    const double moved = strength * random.normal(i);
    for (std::size_t c = 0; c < d; ++c) model.feature[i * d + c] += static_cast<float>(c % 3 == 2 ? -moved : moved);
  }
  model.intra.emplace();
  return model;
}

}  // namespace compmark::testing
