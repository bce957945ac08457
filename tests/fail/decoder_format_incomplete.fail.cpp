// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A kind of decoder files must say how they are read.
// message: StoredDecoder: a format of the list lacks Decoder, kind or read
#include <compmark/io/safetensors.hpp>
#include <compmark/testing/archetypes.hpp>
#include <compmark/watermark/decoder/stored_decoder.hpp>

using namespace compmark;

struct Mine {
  using Decoder = testing::MessageDecoderArchetype<float>;
  static constexpr std::string_view kind = "mine";
#ifndef COMPMARK_MUST_FAIL
  template <class TensorFile>
  static Result<Decoder> read(const TensorFile&, const std::optional<DecoderKey>&) {
    return Decoder();
  }
#endif
};

bool reads(const SafetensorsFile& file) {
  return StoredDecoder<float, DirectConvolution, DecoderFormats<Mine>>::read(file).ok();
}
