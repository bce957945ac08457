// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The HiDDeN decoder in the form of Stable Signature (Zhu et al., ECCV 2018; Fernandez et al., ICCV 2023): `depth`
// blocks of 3 x 3 convolution, batch normalisation (eps 1e-3) and exact GELU at full resolution, one more block to the
// features, mean over positions, linear, whitening (docs/spec/watermark.md, 1.1, 1.3). Cost at 64 x 8 and 48 bits: 0.29
// M multiply-adds a position forward, the same backward.
#pragma once

#include <string>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/network_decoder.hpp"

namespace compmark {

namespace detail {

/// One line where a file's size is not the one fixed in a type (0: any).
[[nodiscard]] inline Result<Done> require_size(const char* field, int fixed, int actual, const std::string& file) {
  if (fixed == 0 || fixed == actual) return Done{};
  return Error{
      ErrorKind::invalid, file, field,
      "the decoder file has " + std::to_string(actual) + ", this program was built for " + std::to_string(fixed),
      "use the decoder it was built for"};
}

/// Sizes that hidden and strided decoders fix, 0 for those that the file says (as Eigen's Dynamic).
template <int Bits, int Width, int Depth>
[[nodiscard]] Result<Done> require_sizes(const DecoderWeights& weights, const std::string& file) {
  for (const Result<Done>& result :
       {require_size("bits", Bits, weights.bits, file), require_size("width", Width, weights.width, file),
        require_size("depth", Depth, weights.depth, file)}) {
    if (!result) return result;
  }
  return Done{};
}

}  // namespace detail

/// Sizes given as template arguments are checked when the weights are; 0 takes the file's.
template <int Bits = 0, int Width = 0, int Depth = 0, class T = float,
          template <class> class Kernel = DirectConvolution>
class HiddenDecoder : public NetworkDecoder<T, Kernel> {
 public:
  HiddenDecoder() = default;
  /// `file` is for messages.
  [[nodiscard]] static Result<HiddenDecoder> create(const DecoderWeights& weights, const std::string& file = {}) {
    if (weights.kind != DecoderKind::hidden) return detail::wrong_kind("hidden", file);
    const Result<Done> sizes = detail::require_sizes<Bits, Width, Depth>(weights, file);
    if (!sizes) return sizes.error();
    return HiddenDecoder(weights);
  }

 private:
  explicit HiddenDecoder(const DecoderWeights& weights) : NetworkDecoder<T, Kernel>(weights, hidden_head(weights)) {}
};

}  // namespace compmark
