// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The payload decoders of ContextGS: levels, prior, hyperprior, networks, chunks of all levels.
#include "any_section.hpp"
#include "support/context_gs_model.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace compmark;
  static const testing::AnySection fuzz(testing::make_context_gs_model(
      21, {.anchors = 70, .feature_dim = 4, .offset_count = 2, .chunk_anchors = 16, .hidden = 5}, 3));
  fuzz(std::as_bytes(std::span(data, size)));
  return 0;
}
