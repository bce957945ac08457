// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A decoder that nobody trained and a key of its length: it reads bits from any image, the same ones every time.
#pragma once

#include <doctest/doctest.h>

#include <compmark/core/random.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace compmark::testing {

inline LatticeDecoder<float> small_decoder(int bits) {
  LatticeSettings settings;
  settings.measure = LatticeMeasure::colour;
  settings.bits = settings.features = bits;
  settings.sigma = {0.5};
  settings.stride = 1;
  settings.gate = 0.02;
  LatticeWeights<float> weights(settings);
  const Random random(3, 0, random_stage("app decoder"));
  std::uint64_t n = 0;
  for (float& value : weights.frequency) value = static_cast<float>(8 * random.normal(n++));
  for (float& value : weights.phase) value = static_cast<float>(random.uniform(n++));
  for (std::size_t b = 0; b < weights.phase.size(); ++b) weights.head[b * (weights.phase.size() + 1)] = 10;
  return {settings, weights};
}
inline void write_decoder(const std::filesystem::path& path, int bits) {
  REQUIRE(write_lattice<SafetensorsWriter>(small_decoder(bits), "of a test", path).ok());
}
inline OwnerKey small_key(int number, std::size_t bits) {
  Digest256 secret{};
  secret[0] = static_cast<std::byte>(number & 0xff);
  secret[1] = static_cast<std::byte>(number >> 8);
  const Result<OwnerKey> key = make_key(secret, "2026-01-01T00:00:00Z", bits);
  REQUIRE(key.ok());
  return *key;
}

}  // namespace compmark::testing
