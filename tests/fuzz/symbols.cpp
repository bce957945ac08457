// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The entropy coders, by the first byte: any bytes as a chunk of symbols, which if accepted is what its symbols encode
// to; any bytes as models and symbols, which come back, and not from a chunk with one byte changed; any bytes as bits
// of an adaptive stream.
#include <compmark/codec/coder/adaptive_binary.hpp>
#include <compmark/codec/coder/symbol_coder.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>
#include <vector>

namespace {

using namespace compmark;

const GaussianTables& tables() {
  static const GaussianTables instance;
  return instance;
}

void chunk(std::span<const std::uint8_t> data) {
  if (data.size() < 2) return;
  std::vector<SymbolModel> models(data[0]);
  for (std::size_t i = 0; i < models.size(); ++i) {
    models[i].sigma_index = static_cast<std::uint16_t>(data[1] + i);
    models[i].mean = static_cast<std::int32_t>(i * data[1]) - 500;
  }
  std::vector<std::int32_t> symbols(models.size());
  if (!decode_symbols(tables(), models, data.subspan(2), symbols)) return;
  std::vector<std::uint8_t> again;
  encode_symbols(tables(), models, symbols, again);
  const std::span<const std::uint8_t> given = data.subspan(2);
  if (!std::equal(again.begin(), again.end(), given.begin(), given.end())) std::abort();
}

void round_trip(std::span<const std::uint8_t> data) {
  if (data.size() < 3) return;
  const unsigned place = data[0] | static_cast<unsigned>(data[1]) << 8;
  const std::uint8_t change = data[2];
  data = data.subspan(3);
  std::vector<SymbolModel> models;
  std::vector<std::int32_t> symbols;
  for (; data.size() >= 10; data = data.subspan(10)) {
    SymbolModel model;
    std::int32_t symbol = 0;
    std::memcpy(&model.sigma_index, data.data(), 2);
    std::memcpy(&model.mean, data.data() + 2, 4);
    std::memcpy(&symbol, data.data() + 6, 4);
    if (model.sigma_index & 0x100) {  // near its mean: within the window
      symbol = static_cast<std::int32_t>((model.mean >> 5) + symbol % 64);
    }
    models.push_back(model);
    symbols.push_back(symbol);
  }
  std::vector<std::uint8_t> bytes;
  encode_symbols(tables(), models, symbols, bytes);
  std::vector<std::int32_t> again(symbols.size());
  if (!decode_symbols(tables(), models, bytes, again) || again != symbols) std::abort();
  if (bytes.empty() || change == 0) return;
  bytes[place % bytes.size()] = static_cast<std::uint8_t>(bytes[place % bytes.size()] ^ change);
  if (decode_symbols(tables(), models, bytes, again)) std::abort();
}

void bits(std::span<const std::uint8_t> data) {
  BinaryDecoder decoder(data);
  BinaryContext contexts[16], again[16];
  BinaryEncoder encoder;
  for (std::size_t i = 0; i < 16 * data.size() + 16 && !decoder.overrun(); ++i) {
    if (i % 5 == 4) {
      encoder.encode_bits(decoder.decode_bits(static_cast<int>(i % 33)), static_cast<int>(i % 33));
    } else {
      encoder.encode(again[i % 16], decoder.decode(contexts[i % 16]));
    }
    if (decoder.valid()) break;
  }
  if (!decoder.valid()) return;
  const std::vector<std::uint8_t> stream = encoder.finish();
  if (!std::equal(stream.begin(), stream.end(), data.begin(), data.end())) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> rest(data + 1, size - 1);
  data[0] % 3 == 0 ? chunk(rest) : data[0] % 3 == 1 ? round_trip(rest) : bits(rest);
  return 0;
}
