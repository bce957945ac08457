// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The strided decoder: the blocks of HiddenDecoder behind a space-to-depth stem of 2 x 2 or 4 x 4 pixels, so that they
// work on a quarter or a sixteenth of the positions. 32 channels and 5 blocks behind 2 x 2 have 59,000 parameters and
// take 0.013 M multiply-adds a pixel, a twentieth of the full HiDDeN decoder (docs/spec/watermark.md, 1.6).
#pragma once

#include <string>

#include "compmark/core/result.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "compmark/watermark/decoder/network_decoder.hpp"

namespace compmark {

/// Sizes given as template arguments are checked when the weights are; 0 takes the file's.
template <int Bits = 0, int Width = 0, int Depth = 0, int Stem = 0, class T = float,
          template <class> class Kernel = DirectConvolution>
class StridedDecoder : public NetworkDecoder<T, Kernel> {
  static_assert(Stem == 0 || Stem == 2 || Stem == 4, "StridedDecoder: a stem of 2 or 4");

 public:
  StridedDecoder() = default;
  /// `file` is for messages.
  [[nodiscard]] static Result<StridedDecoder> create(const DecoderWeights& weights, const std::string& file = {}) {
    if (weights.kind != DecoderKind::strided) return detail::wrong_kind("strided", file);
    Result<Done> sizes = detail::require_sizes<Bits, Width, Depth>(weights, file);
    if (sizes) sizes = detail::require_size("stem", Stem, weights.stem, file);
    if (!sizes) return sizes.error();
    return StridedDecoder(weights);
  }

 private:
  explicit StridedDecoder(const DecoderWeights& weights) : NetworkDecoder<T, Kernel>(weights, hidden_head(weights)) {}
};

}  // namespace compmark
