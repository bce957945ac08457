// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a message says, as a soft-binding assertion of C2PA ("c2pa.soft-binding", specification 2.2, soft-binding.cddl):
// the CBOR that goes into a manifest, beside the asset or into one. A soft binding finds a manifest again when the
// asset has lost it; it is no proof, and nothing here is signed. The value is text, as the reference reader (c2pa-rs)
// takes it: the bits that were read, in hexadecimal digits. CBOR is the deterministic one of RFC 8949, 4.2.1.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace compmark {

struct SoftBinding {
  /// Name of the algorithm, by which a reader finds the decoder; docs/soft_binding.md has the entry of the public list.
  std::string algorithm;
  std::string value;  ///< the bits, hexadecimal
  std::string name;   ///< for people; empty: none
};

/// The name of a decoder's algorithm: "org.compmark.universal3-64.48" for universal3_64.safetensors and 48 bits.
[[nodiscard]] inline std::string soft_binding_algorithm(std::string_view decoder_file, std::size_t bits) {
  std::string name = "org.compmark.";
  for (const char c : decoder_file.substr(0, decoder_file.rfind('.'))) {
    const bool kept = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    const bool capital = c >= 'A' && c <= 'Z';
    name += kept ? c : capital ? static_cast<char>(c - 'A' + 'a') : '-';
  }
  return name + "." + std::to_string(bits);
}

namespace detail {

/// The head of an item of CBOR: its major type and its number, in the fewest bytes.
inline void cbor_head(std::vector<std::byte>& out, unsigned major, std::uint64_t number) {
  const auto put = [&](std::uint64_t byte) { out.push_back(static_cast<std::byte>(byte & 0xff)); };
  if (number < 24) return put(major << 5 | number);
  const int bytes = number < 0x100 ? 1 : number < 0x10000 ? 2 : number < 0x100000000 ? 4 : 8;
  put(major << 5 | (bytes == 1 ? 24u : bytes == 2 ? 25u : bytes == 4 ? 26u : 27u));
  for (int i = bytes - 1; i >= 0; --i) put(number >> (8 * i));
}
inline void cbor_text(std::vector<std::byte>& out, std::string_view text) {
  cbor_head(out, 3, text.size());
  for (const char c : text) out.push_back(static_cast<std::byte>(c));
}

}  // namespace detail

/// The assertion's bytes. Keys are in the order of their encoding: alg, pad, name, blocks.
[[nodiscard]] inline std::vector<std::byte> soft_binding_cbor(const SoftBinding& binding) {
  constexpr unsigned bytes = 2, list = 4, map = 5;
  std::vector<std::byte> out;
  detail::cbor_head(out, map, binding.name.empty() ? 3 : 4);
  detail::cbor_text(out, "alg");
  detail::cbor_text(out, binding.algorithm);
  detail::cbor_text(out, "pad");
  detail::cbor_head(out, bytes, 0);
  if (!binding.name.empty()) {
    detail::cbor_text(out, "name");
    detail::cbor_text(out, binding.name);
  }
  detail::cbor_text(out, "blocks");
  detail::cbor_head(out, list, 1);  // one block for the whole asset, whose scope is empty
  detail::cbor_head(out, map, 2);
  detail::cbor_text(out, "scope");
  detail::cbor_head(out, map, 0);
  detail::cbor_text(out, "value");
  detail::cbor_text(out, binding.value);
  return out;
}

}  // namespace compmark
