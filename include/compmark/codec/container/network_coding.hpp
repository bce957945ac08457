// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The networks of a file: NETC, the integer context network, and NETR, the tensors that render
// (docs/spec/compression.md, 4.2). Numbers are split into what is predictable (sign and size: adaptive bits) and what
// is not (the low digits: one bit each), which takes a seventh off half precision and a twelfth off weights that are
// integers already. Every count is checked against the payload before memory is taken.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/coder/bits.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"
#include "compmark/io/half.hpp"

namespace compmark {

namespace detail {

[[nodiscard]] inline Error bad_network(const char* section, std::string problem) {
  return {ErrorKind::malformed, "", section, std::move(problem), "copy the file again"};
}

/// Integers in rows: length of |w| by the length above it in the column, sign, second digit by the length, the rest
/// raw.
template <class Bits>
void code_integers(Bits& bits, std::span<std::int16_t> weights, std::size_t columns) {
  std::array<std::array<BinaryContext, 15>, 16> length{};
  std::array<BinaryContext, 16> second{};
  std::vector<std::size_t> above(columns, 0);
  for (std::size_t i = 0; i < weights.size() && !bits.overrun(); ++i) {
    const std::size_t column = i % columns;
    const std::int32_t weight = weights[i];
    const auto magnitude = static_cast<std::uint32_t>(weight < 0 ? -weight : weight);
    const std::uint32_t digits =
        bits.tree(length[above[column]], static_cast<std::uint32_t>(std::bit_width(magnitude)), 4);
    above[column] = digits;
    bool negative = false;
    if (digits > 0) negative = bits.raw(weight < 0 ? 1 : 0, 1) != 0;
    std::uint32_t value = digits > 0 ? 1 : 0;
    if (digits > 1) value = value << 1 | (bits(second[digits], (magnitude >> (digits - 2) & 1u) != 0) ? 1u : 0u);
    if (digits > 2) {
      const int rest = static_cast<int>(digits) - 2;
      value = value << rest | bits.raw(magnitude & ((1u << rest) - 1), rest);
    }
    if constexpr (!Bits::writes) {
      const auto signless = static_cast<std::int32_t>(value);
      weights[i] = static_cast<std::int16_t>(negative ? -signless : signless);
    }
  }
}

/// Rows of a tensor as integers of `bits` bits times 2^-exponent, the largest exponent of each row that fits.
struct IntegerTensor {
  std::vector<std::int8_t> exponent;
  std::vector<std::int16_t> weight;
  std::size_t columns = 1;
};
/// Nothing when a row's exponent leaves [-64, 64]. What comes out, put in again, comes out again.
[[nodiscard]] inline std::optional<IntegerTensor> integer_tensor(const CodecTensor& tensor) {
  IntegerTensor result;
  result.columns = tensor.shape.size() < 2 ? tensor.values.size() : tensor.shape.back();
  result.weight.resize(tensor.values.size());
  const double greatest = (1 << (tensor.bits - 1)) - 1;
  for (std::size_t begin = 0; begin < tensor.values.size(); begin += result.columns) {
    double most = 0;
    for (std::size_t c = 0; c < result.columns; ++c)
      most = std::max(most, std::abs(static_cast<double>(tensor.values[begin + c])));
    int exponent = 0;
    if (most > 0) {
      (void)std::frexp(most / greatest, &exponent);
      exponent = 1 - exponent;  // most 2^exponent is in [greatest, 2 greatest) or just below
      while (std::nearbyint(std::ldexp(most, exponent)) > greatest) --exponent;
      if (exponent < -64 || exponent > 64) return std::nullopt;
    }
    result.exponent.push_back(static_cast<std::int8_t>(exponent));
    for (std::size_t c = 0; c < result.columns; ++c) {
      result.weight[begin + c] = static_cast<std::int16_t>(
          std::nearbyint(std::ldexp(static_cast<double>(tensor.values[begin + c]), exponent)));
    }
  }
  return result;
}

/// Half-precision numbers: exponent by that of the number before, first two digits of the mantissa by the exponent, the
/// rest and the sign raw.
template <class Bits>
void code_halves(Bits& bits, std::span<std::uint16_t> values) {
  std::array<std::array<BinaryContext, 31>, 32> exponent{};
  std::array<std::array<BinaryContext, 3>, 32> first{};
  std::size_t before = 0;
  for (std::uint16_t& value : values) {
    if (bits.overrun()) return;
    const std::uint32_t v = value, sign = bits.raw(v >> 15, 1);
    const std::uint32_t e = bits.tree(exponent[before], v >> 10 & 31u, 5);
    const std::uint32_t two = bits.tree(first[e], v >> 8 & 3u, 2);
    const std::uint32_t rest = bits.raw(v & 255u, 8);
    if constexpr (!Bits::writes) value = static_cast<std::uint16_t>(sign << 15 | e << 10 | two << 8 | rest);
    before = e;
  }
}

}  // namespace detail

/// NETC: hidden units (u32); of each layer per row shift (i8) and bias (i32); then the weights of both as one stream.
[[nodiscard]] inline std::vector<std::byte> encode_context_network(const IntegerNetwork& network) {
  ByteWriter writer;
  writer.put(static_cast<std::uint32_t>(network.hidden.outputs));
  for (const IntegerLayer* layer : {&network.hidden, &network.output}) {
    for (const std::int8_t shift : layer->shift) writer.put(shift);
    for (const std::int32_t bias : layer->bias) writer.put(bias);
  }
  detail::BitsOut bits;
  IntegerNetwork copy = network;
  detail::code_integers(bits, std::span<std::int16_t>(copy.hidden.weight), copy.hidden.inputs);
  detail::code_integers(bits, std::span<std::int16_t>(copy.output.weight), copy.output.inputs);
  writer.put(bits.finish());
  return writer.take();
}

/// `inputs` and `outputs` are known from what has been decoded before.
[[nodiscard]] inline Result<IntegerNetwork> decode_context_network(std::span<const std::byte> payload,
                                                                   std::size_t inputs, std::size_t outputs) {
  ByteReader reader(payload);
  const std::uint32_t hidden = reader.get<std::uint32_t>();
  if (hidden == 0 || hidden > IntegerNetwork::most_hidden_units)
    return detail::bad_network("NETC", std::to_string(hidden) + " hidden units are not 1 to 4096");
  if (reader.left() < 5 * (std::uint64_t{hidden} + outputs)) return detail::bad_network("NETC", "ends in its biases");
  if (const std::uint64_t weights = std::uint64_t{hidden} * (inputs + outputs);
      weights > (std::uint64_t{1} << 21) + 64 * reader.left()) {
    return detail::bad_network("NETC", std::to_string(weights) + " weights are more than its bytes hold");
  }
  IntegerNetwork network;
  network.hidden.inputs = inputs;
  network.hidden.outputs = network.output.inputs = hidden;
  network.output.outputs = outputs;
  for (IntegerLayer* layer : {&network.hidden, &network.output}) {
    layer->weight.resize(layer->inputs * layer->outputs);
    layer->shift.resize(layer->outputs);
    layer->bias.resize(layer->outputs);
    for (std::int8_t& shift : layer->shift) shift = reader.get<std::int8_t>();
    for (std::int32_t& bias : layer->bias) bias = reader.get<std::int32_t>();
  }
  detail::BitsIn bits(reader.take(reader.left()));
  detail::code_integers(bits, std::span<std::int16_t>(network.hidden.weight), network.hidden.inputs);
  detail::code_integers(bits, std::span<std::int16_t>(network.output.weight), network.output.inputs);
  if (!bits.complete()) return detail::bad_network("NETC", "the weights do not end where their bytes do");
  return network;
}

/// NETR: number of tensors (u32); of each the length of its name (u8), the name, storage (u8), bits (u8), rank (u8),
/// extents (u32), bytes of its values (u32), the values.
[[nodiscard]] inline std::vector<std::byte> encode_networks(std::span<const CodecTensor> tensors) {
  ByteWriter writer;
  writer.put(static_cast<std::uint32_t>(tensors.size()));
  for (const CodecTensor& tensor : tensors) {
    TensorStorage storage = tensor.storage;
    ByteWriter values;
    if (storage == TensorStorage::integer) {
      std::optional<detail::IntegerTensor> integers = detail::integer_tensor(tensor);
      if (integers) {
        for (const std::int8_t exponent : integers->exponent) values.put(exponent);
        detail::BitsOut bits;
        detail::code_integers(bits, std::span<std::int16_t>(integers->weight), integers->columns);
        values.put(bits.finish());
      } else {
        storage = TensorStorage::half;
      }
    }
    if (storage == TensorStorage::half) {
      std::vector<std::uint16_t> halves(tensor.values.size());
      for (std::size_t i = 0; i < halves.size(); ++i) {
        halves[i] = detail::float_to_half(tensor.values[i]);
        if ((halves[i] & 0x7C00u) == 0x7C00u) storage = TensorStorage::single;
      }
      detail::BitsOut bits;
      detail::code_halves(bits, std::span<std::uint16_t>(halves));
      if (storage == TensorStorage::half) values.put(bits.finish());
    }
    if (storage == TensorStorage::single) {
      for (const float value : tensor.values) values.put(value);
    }
    writer.put(static_cast<std::uint8_t>(tensor.name.size())).put(std::string_view(tensor.name));
    writer.put(static_cast<std::uint8_t>(storage)).put(static_cast<std::uint8_t>(tensor.bits));
    writer.put(static_cast<std::uint8_t>(tensor.shape.size()));
    for (const std::uint32_t extent : tensor.shape) writer.put(extent);
    writer.put(static_cast<std::uint32_t>(values.size())).put(values.bytes());
  }
  return writer.take();
}

/// A tensor has at most 2^20 (bytes + 64) values, of the bytes that are stored of it, and all of them 2^26 together.
[[nodiscard]] inline Result<std::vector<CodecTensor>> decode_networks(std::span<const std::byte> payload) {
  constexpr std::uint64_t count_limit = std::uint64_t{1} << 26;
  ByteReader reader(payload);
  const std::size_t count = reader.count(8);
  std::vector<CodecTensor> tensors;
  std::uint64_t total = 0;
  for (std::size_t t = 0; t < count && !reader.failed(); ++t) {
    CodecTensor tensor;
    tensor.name = reader.text(reader.get<std::uint8_t>());
    const auto storage = reader.get<std::uint8_t>();
    tensor.bits = reader.get<std::uint8_t>();
    const auto rank = reader.get<std::uint8_t>();
    if (reader.failed()) break;
    if (tensor.bits < 2 || tensor.bits > 16)
      return detail::bad_network("NETR", tensor.name + " has " + std::to_string(tensor.bits) + " bits, not 2 to 16");
    if (rank > 8) return detail::bad_network("NETR", "a tensor has " + std::to_string(rank) + " dimensions");
    std::uint64_t values = 1;
    for (std::uint8_t d = 0; d < rank; ++d) {
      tensor.shape.push_back(reader.get<std::uint32_t>());
      if (!checked_product(values, tensor.shape.back(), values))
        return detail::bad_network("NETR", "the product of a shape overflows");
    }
    const std::span<const std::byte> bytes = reader.take(reader.get<std::uint32_t>());
    if (reader.failed()) break;
    total += std::min(values, count_limit);
    if (values == 0 || total > count_limit) return detail::bad_network("NETR", tensor.name + " is empty or too large");
    if (storage == static_cast<std::uint8_t>(TensorStorage::single)) {
      tensor.storage = TensorStorage::single;
      if (bytes.size() != 4 * values) return detail::bad_network("NETR", tensor.name + " has bytes of another shape");
      ByteReader source(bytes);
      for (std::uint64_t i = 0; i < values; ++i) tensor.values.push_back(source.get<float>());
    } else if (storage == static_cast<std::uint8_t>(TensorStorage::half)) {
      if (values > 64 + (std::uint64_t{bytes.size()} * 8))
        return detail::bad_network("NETR", tensor.name + " has too few bytes");
      std::vector<std::uint16_t> halves(static_cast<std::size_t>(values));
      detail::BitsIn bits(bytes);
      detail::code_halves(bits, halves);
      if (!bits.complete()) return detail::bad_network("NETR", tensor.name + " does not end where its bytes do");
      for (const std::uint16_t value : halves) tensor.values.push_back(detail::half_to_float(value));
    } else if (storage == static_cast<std::uint8_t>(TensorStorage::integer)) {
      tensor.storage = TensorStorage::integer;
      const std::uint64_t columns = rank < 2 ? values : tensor.shape.back();
      const std::uint64_t rows = values / columns;
      if (rows > bytes.size() || values > (std::uint64_t{1} << 20) + 64 * std::uint64_t{bytes.size()}) {
        return detail::bad_network("NETR", tensor.name + " has too few bytes");
      }
      ByteReader source(bytes);
      std::vector<std::int8_t> exponents(static_cast<std::size_t>(rows));
      for (std::int8_t& exponent : exponents) exponent = source.get<std::int8_t>();
      std::vector<std::int16_t> integers(static_cast<std::size_t>(values));
      detail::BitsIn bits(source.take(source.left()));
      detail::code_integers(bits, std::span<std::int16_t>(integers), static_cast<std::size_t>(columns));
      if (!bits.complete()) return detail::bad_network("NETR", tensor.name + " does not end where its bytes do");
      const int greatest = (1 << (tensor.bits - 1)) - 1;
      for (std::size_t i = 0; i < integers.size(); ++i) {
        if (std::abs(int{integers[i]}) > greatest)
          return detail::bad_network("NETR", tensor.name + " holds a weight that its bits do not");
        tensor.values.push_back(
            static_cast<float>(std::ldexp(static_cast<double>(integers[i]), -exponents[i / columns])));
      }
    } else {
      return detail::bad_network("NETR", tensor.name + ": storage " + std::to_string(storage) + " is not known");
    }
    for (const float value : tensor.values) {
      if (!std::isfinite(value)) return detail::bad_network("NETR", tensor.name + " holds a value that is not finite");
    }
    tensors.push_back(std::move(tensor));
  }
  if (!reader.complete()) return detail::bad_network("NETR", "its tensors do not end where it does");
  return tensors;
}

}  // namespace compmark
