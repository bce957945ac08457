// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The payload decoders of HAC-plus: what those of HAC do not have, the context inside anchors, the coarse level and
// what refines it.
#include "any_section.hpp"
#include "codec/hac_plus/correlated_model.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace compmark;
  static const testing::AnySection fuzz([] {
    CodecModel model = testing::make_correlated_model(
        21, {40, 4, 2, 16, 5, {.volume_levels = 1, .volume_cap_log2 = 5, .plane_levels = 1, .plane_cap_log2 = 6}, true},
        5);
    model.first_level = CoarseSteps{{2, 1, 3}};
    return model;
  }());
  fuzz(std::as_bytes(std::span(data, size)));
  return 0;
}
