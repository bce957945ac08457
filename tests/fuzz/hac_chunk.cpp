// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The payload decoders of HAC: masks, symbols, hash grid, networks, digests, numbers.
#include "any_section.hpp"
#include "support/codec_model.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace compmark;
  static const testing::AnySection fuzz(testing::make_codec_model(
      21, {40, 4, 2, 16, 5, {.volume_levels = 1, .volume_cap_log2 = 5, .plane_levels = 1, .plane_cap_log2 = 6}, true}));
  fuzz(std::as_bytes(std::span(data, size)));
  return 0;
}
