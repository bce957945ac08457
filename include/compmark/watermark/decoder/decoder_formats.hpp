// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Kinds of decoder files, an open list: each kind is a type that reads its files, and ShippedDecoders at the end is the
// one place that lists them. StoredDecoder holds a decoder of any kind of a list.
//
//   DecoderFormat            meaning                                                                          cost
//   typename F::Decoder      the MessageDecoder of such a file; logit_scale() may be left out (1)             -
//   F::kind                  the text that its files have as metadata "kind"                                  -
//   F::read(file, key)       Result<Decoder>; no number is believed before it is checked. `key` is there for  a pass
//                            what an owner's key adds to the file, and is empty where none was given
//
// To add a kind: its type beside the decoder, and its name in the list.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/watermark/decoder/carrier_decoder.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/decoder_reader.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"
#include "compmark/watermark/decoder/strided_decoder.hpp"
#include "compmark/watermark/proof/carrier_stream.hpp"
#include "compmark/watermark/proof/key.hpp"

namespace compmark {

/// The part of an owner's key that a decoder may need.
struct DecoderKey {
  std::array<std::uint64_t, 4> seed{};  ///< of the secret carriers
  int bits = 0;                         ///< of the message
};
template <SecretKey K>
[[nodiscard]] DecoderKey decoder_key(const K& key) {
  return {carrier_seed(key), static_cast<int>(key.bits)};
}

template <class F, class TensorFile>
concept DecoderFormat = MessageDecoder<typename F::Decoder> &&
    requires(const TensorFile& file, const std::optional<DecoderKey>& key) {
  { F::kind } -> std::convertible_to<std::string_view>;
  { F::read(file, key) } -> std::same_as<Result<typename F::Decoder>>;
};

namespace detail {
/// Reads the file of a network whose type takes all that is in it.
template <class Network, class TensorFile>
[[nodiscard]] Result<Network> read_network(const TensorFile& file) {
  const Result<DecoderWeights> weights = read_decoder(file);
  if (!weights) return weights.error();
  return Network::create(*weights, file.path);
}
}  // namespace detail

/// Files without a format are the published ones, of this kind too.
template <class T, template <class> class Kernel>
struct HiddenFormat {
  using Decoder = HiddenDecoder<0, 0, 0, T, Kernel>;
  static constexpr std::string_view kind = "hidden";
  template <class TensorFile>
  [[nodiscard]] static Result<Decoder> read(const TensorFile& file, const std::optional<DecoderKey>& /*key*/) {
    return detail::read_network<Decoder>(file);
  }
};

template <class T, template <class> class Kernel>
struct StridedFormat {
  using Decoder = StridedDecoder<0, 0, 0, 0, T, Kernel>;
  static constexpr std::string_view kind = "strided";
  template <class TensorFile>
  [[nodiscard]] static Result<Decoder> read(const TensorFile& file, const std::optional<DecoderKey>& /*key*/) {
    return detail::read_network<Decoder>(file);
  }
};

/// The carriers come from the key; without one there is no decoder.
template <class T, template <class> class Kernel>
struct CarrierFormat {
  using Decoder = CarrierDecoder<T, Kernel>;
  static constexpr std::string_view kind = "carrier";
  template <class TensorFile>
  [[nodiscard]] static Result<Decoder> read(const TensorFile& file, const std::optional<DecoderKey>& key) {
    const Result<DecoderWeights> weights = read_decoder(file);
    if (!weights) return weights.error();
    if (!key) return Decoder::create(*weights, {}, file.path);
    if (Result<Done> fits = require_bits(*weights, key->bits, file.path); !fits) return fits.error();
    return Decoder::create(*weights, make_carriers(key->seed, key->bits, weights->dimension()), file.path);
  }
};

template <class T>
struct LatticeFormat {
  using Decoder = LatticeDecoder<T>;
  static constexpr std::string_view kind = "lattice";
  template <class TensorFile>
  [[nodiscard]] static Result<Decoder> read(const TensorFile& file, const std::optional<DecoderKey>& /*key*/) {
    return read_lattice<T>(file);
  }
};

/// A list of kinds. A file that names no kind is read as the first.
template <class... Formats>
struct DecoderFormats {
  template <class Added>
  using With = DecoderFormats<Formats..., Added>;
};

/// All kinds that CompMark reads.
template <class T, template <class> class Kernel>
using ShippedDecoders =
    DecoderFormats<HiddenFormat<T, Kernel>, StridedFormat<T, Kernel>, CarrierFormat<T, Kernel>, LatticeFormat<T>>;

}  // namespace compmark
