// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An owner's claim: one line of text that names the commitment of a key, the decoder that reads its marks and, where
// they are used, the unmarked model and the file of what it says by itself. It tells no secret. Published where others
// date it, before the marked scene is, it shows that none of these was made to fit a picture (docs/threat_model.md).
// The file holds the line and nothing else, so that sha256sum and a time stamp (RFC 3161) of the file are those of the
// line:
//   compmark-claim 1 key=<64 digits> decoder=<64 digits> unmarked=<64 digits or none> interference=<64 digits or none>
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/hmac_sha256.hpp"
#include "compmark/io/read_file.hpp"

namespace compmark {

struct OwnerClaim {
  static constexpr std::string_view head = "compmark-claim 1";

  std::string key;           ///< OwnerKey::commitment
  std::string decoder;       ///< SHA-256 of the decoder's file
  std::string unmarked;      ///< SHA-256 of the unmarked model's file; empty: none
  std::string interference;  ///< SHA-256 of the file of measure_interference; empty: none

  /// The line, with its end.
  [[nodiscard]] std::string text() const {
    const auto or_none = [](const std::string& digits) { return digits.empty() ? std::string("none") : digits; };
    return std::string(head) + " key=" + key + " decoder=" + decoder + " unmarked=" + or_none(unmarked) +
           " interference=" + or_none(interference) + "\n";
  }
  /// SHA-256 of the file: what is published, or stamped with a time.
  [[nodiscard]] Digest256 digest() const { return sha256_digest({bytes_of(text())}); }
};

[[nodiscard]] inline Result<Done> write_claim(const std::filesystem::path& path, const OwnerClaim& claim) {
  return write_file(path, claim.text());
}

/// Reads a file of write_claim; one that differs from it in any byte is refused.
[[nodiscard]] inline Result<OwnerClaim> read_claim(const std::filesystem::path& path) {
  constexpr std::size_t limit = 1024;
  const Result<std::vector<std::byte>> bytes = read_file(path, limit);
  if (!bytes) return bytes.error();
  const std::string text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  const auto fail = [&](std::string field, std::string problem) {
    return Error{ErrorKind::malformed, path.string(), std::move(field), std::move(problem),
                 "give the file that compmark claim wrote, unchanged"};
  };
  if (text.substr(0, OwnerClaim::head.size()) != OwnerClaim::head) return fail("", "is no claim of an owner");
  OwnerClaim claim;
  std::size_t at = OwnerClaim::head.size();
  for (const auto& [name, digits, needed] :
       {std::tuple(" key=", &claim.key, true), std::tuple(" decoder=", &claim.decoder, true),
        std::tuple(" unmarked=", &claim.unmarked, false), std::tuple(" interference=", &claim.interference, false)}) {
    const std::string_view label = name;
    const std::string field(label.substr(1, label.size() - 2));
    if (text.compare(at, label.size(), label) != 0) return fail(field, "is missing");
    at += label.size();
    if (!needed && text.compare(at, 4, "none") == 0) {
      at += 4;
      continue;
    }
    Digest256 digest{};
    *digits = text.substr(at, 2 * digest.size());
    if (!from_hex(*digits, digest) || to_hex(digest) != *digits) return fail(field, "is not 64 hexadecimal digits");
    at += digits->size();
  }
  if (text != claim.text()) return fail("", "has something after its line");
  return claim;
}

}  // namespace compmark
