// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The decoder files that were published with this library (weights/), by their SHA-256. A picture is proven to carry a
// message only with a decoder that nobody could make for it: one of these, or one that a published claim names
// (standing.hpp). A file that is replaced stays in the list: marks that it reads are as old as they were.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace compmark {

struct ShippedDecoder {
  std::string_view name, sha256;
};

inline constexpr std::array<ShippedDecoder, 7> shipped_decoders{{
    {"universal3_64", "29dd21682466bf5194cf6831ca3812c4be920201ed85119abcc4a112aebc6f59"},
    {"universal3_64, November 2026, reads the whole picture alone",
     "eb0f5cdb133404415616f0ece8f054c9bb917c2e911bad012f86a99accc7f862"},
    {"universal3_64, November 2026, first form", "bd0ed25d2e2a3510841a5e520fe87686100f350c801df34af6a184bddc118160"},
    {"universal2_64", "ebf58dceb2537f72d1ac5e4e7f0709bd1106fb3308ff147675bc4b2edc81bd57"},
    {"lattice_32", "745e1c7626911a4175b0027a7e30a9b3142744dd575b2122bc02d51b1b977c8f"},
    {"lattice_48", "184f92b013a8c4647dea4cb4bd1b04f52dfcd4ce9c15eec5fe3cd6593b2c79ef"},
    {"lattice_64", "b7838b670ab68f622323c77f326a39fd18cd90e96061727ee74f61b8d1e4c4e5"},
}};

/// The shipped decoder with this SHA-256, if there is one.
[[nodiscard]] constexpr std::optional<ShippedDecoder> shipped_decoder_of(std::string_view sha256) {
  for (const ShippedDecoder& decoder : shipped_decoders) {
    if (decoder.sha256 == sha256) return decoder;
  }
  return std::nullopt;
}

/// How many of them read a message of so many bits: the universal ones along 64 carriers or fewer, a lattice its own.
[[nodiscard]] constexpr std::size_t shipped_decoders_reading(std::size_t bits) {
  std::size_t count = 0;
  for (const ShippedDecoder& decoder : shipped_decoders) {
    const bool universal = decoder.name.substr(0, 9) == "universal";
    count += universal ? bits <= 64
                       : decoder.name == (bits == 32   ? "lattice_32"
                                          : bits == 48 ? "lattice_48"
                                          : bits == 64 ? "lattice_64"
                                                       : "");
  }
  return count;
}

}  // namespace compmark
