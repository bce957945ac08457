// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Time stamps (RFC 3161), as a time-stamping authority answers them: of which bytes, and when. The answer or the bare
// token is read as DER (X.690); its signature is NOT checked, which needs the authority's certificate: OpenSSL does
// that (`openssl ts -verify -data CLAIM -in STAMP -CAfile CA`). Every length is checked against the bytes that are
// there. Cost: one pass.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/io/hmac_sha256.hpp"

namespace compmark {

struct TimeStamp {
  Digest256 digest{};  ///< SHA-256 of what is stamped
  std::string time;    ///< UTC, "2026-01-31T23:59:59Z", fractions of a second cut off
};

namespace detail {

/// The elements of DER bytes, one after the other.
class DerReader {
 public:
  struct Element {
    unsigned tag = 0;
    ByteSpan content;
  };
  explicit DerReader(ByteSpan bytes) : rest_(bytes) {}

  /// The next element, if there is a whole one.
  [[nodiscard]] std::optional<Element> next() {
    if (rest_.size() < 2) return std::nullopt;
    const unsigned tag = std::to_integer<unsigned>(rest_[0]), first = std::to_integer<unsigned>(rest_[1]);
    std::size_t at = 2, length = first;
    if (first > 0x84 || first == 0x80) return std::nullopt;  // longer than 4 GiB, or not DER
    if (first > 0x80) {
      length = 0;
      for (unsigned i = 0; i < first - 0x80; ++i, ++at) {
        if (at >= rest_.size()) return std::nullopt;
        length = length << 8 | std::to_integer<std::size_t>(rest_[at]);
      }
    }
    if (length > rest_.size() - at) return std::nullopt;
    const Element element{tag, rest_.subspan(at, length)};
    rest_ = rest_.subspan(at + length);
    return element;
  }
  [[nodiscard]] bool at_end() const { return rest_.empty(); }
  /// The content of the next element, if it has this tag.
  [[nodiscard]] std::optional<ByteSpan> next(unsigned tag) {
    const std::optional<Element> element = next();
    if (!element || element->tag != tag) return std::nullopt;
    return element->content;
  }

 private:
  ByteSpan rest_;
};

inline constexpr unsigned der_integer = 0x02, der_octets = 0x04, der_object = 0x06, der_time = 0x18,
                          der_sequence = 0x30, der_explicit = 0xA0;

[[nodiscard]] inline bool is_object(std::optional<ByteSpan> content, std::span<const std::uint8_t> identifier) {
  if (!content || content->size() != identifier.size()) return false;
  for (std::size_t i = 0; i < identifier.size(); ++i) {
    if (std::to_integer<std::uint8_t>((*content)[i]) != identifier[i]) return false;
  }
  return true;
}

/// TSTInfo of an answer (TimeStampResp) or of a token (ContentInfo); empty where the bytes are neither.
[[nodiscard]] inline std::optional<ByteSpan> time_stamp_info(ByteSpan bytes) {
  constexpr std::array<std::uint8_t, 9> signed_data{0x2A, 0x86, 0x48, 0x86, 0xF7, 0x0D, 0x01, 0x07, 0x02};
  constexpr std::array<std::uint8_t, 11> info{0x2A, 0x86, 0x48, 0x86, 0xF7, 0x0D, 0x01, 0x09, 0x10, 0x01, 0x04};
  DerReader file(bytes);
  const std::optional<ByteSpan> outer = file.next(der_sequence);
  if (!outer || !file.at_end()) return std::nullopt;
  DerReader token(*outer);
  std::optional<DerReader::Element> first = token.next();
  if (first && first->tag == der_sequence) {  // an answer: its status, then the token
    const std::optional<ByteSpan> inner = token.next(der_sequence);
    if (!inner) return std::nullopt;
    token = DerReader(*inner);
    first = token.next();
  }
  if (!first || first->tag != der_object || !is_object(first->content, signed_data)) return std::nullopt;
  const std::optional<ByteSpan> wrapped = token.next(der_explicit);
  if (!wrapped) return std::nullopt;
  const std::optional<ByteSpan> data = DerReader(*wrapped).next(der_sequence);
  if (!data) return std::nullopt;
  DerReader fields(*data);
  if (!fields.next(der_integer) || !fields.next()) return std::nullopt;  // version, digest algorithms
  const std::optional<ByteSpan> content = fields.next(der_sequence);
  if (!content) return std::nullopt;
  DerReader parts(*content);
  if (!is_object(parts.next(der_object), info)) return std::nullopt;
  const std::optional<ByteSpan> octets = parts.next(der_explicit);
  if (!octets) return std::nullopt;
  const std::optional<ByteSpan> written = DerReader(*octets).next(der_octets);
  if (!written) return std::nullopt;
  return DerReader(*written).next(der_sequence);
}

/// "20260131235959Z" or "20260131235959.5Z" as "2026-01-31T23:59:59Z"; empty where that is no time.
[[nodiscard]] inline std::optional<std::string> time_of_der(ByteSpan content) {
  const std::string_view text(reinterpret_cast<const char*>(content.data()), content.size());
  if (text.size() < 15 || text.back() != 'Z') return std::nullopt;
  const auto digits = [](std::string_view part) {
    return !part.empty() && part.find_first_not_of("0123456789") == std::string_view::npos;
  };
  const std::string_view fraction = text.substr(14, text.size() - 15);
  if (!digits(text.substr(0, 14)) || !(fraction.empty() || (fraction[0] == '.' && digits(fraction.substr(1)))))
    return std::nullopt;
  const auto number = [&](std::size_t at) { return 10 * (text[at] - '0') + (text[at + 1] - '0'); };
  if (number(4) < 1 || number(4) > 12 || number(6) < 1 || number(6) > 31 || number(8) > 23 || number(10) > 59 ||
      number(12) > 60)  // 60: a leap second
    return std::nullopt;
  const auto part = [&](std::size_t at, std::size_t count) { return std::string(text.substr(at, count)); };
  return part(0, 4) + "-" + part(4, 2) + "-" + part(6, 2) + "T" + part(8, 2) + ":" + part(10, 2) + ":" + part(12, 2) +
         "Z";
}

}  // namespace detail

/// Reads an answer of a time-stamping authority, or its token. `file` is for messages.
[[nodiscard]] inline Result<TimeStamp> read_time_stamp(ByteSpan bytes, const std::string& file) {
  constexpr std::array<std::uint8_t, 9> sha256{0x60, 0x86, 0x48, 0x01, 0x65, 0x03, 0x04, 0x02, 0x01};
  const auto fail = [&](std::string problem, std::string remedy) {
    return Error{ErrorKind::malformed, file, "", std::move(problem), std::move(remedy)};
  };
  const std::optional<ByteSpan> info = detail::time_stamp_info(bytes);
  if (!info) return fail("is no time stamp (RFC 3161), or a request that was refused", "give the authority's answer");
  detail::DerReader fields(*info);
  const bool begins = fields.next(detail::der_integer) && fields.next(detail::der_object);  // version, policy
  const std::optional<ByteSpan> imprint = begins ? fields.next(detail::der_sequence) : std::nullopt;
  const bool numbered = imprint && fields.next(detail::der_integer);
  const std::optional<ByteSpan> time = numbered ? fields.next(detail::der_time) : std::nullopt;
  const std::optional<std::string> utc = time ? detail::time_of_der(*time) : std::nullopt;
  if (!utc) return fail("is a damaged time stamp", "restore the file from a copy");
  detail::DerReader hashed(*imprint);
  const std::optional<ByteSpan> algorithm = hashed.next(detail::der_sequence);
  const std::optional<ByteSpan> digest = hashed.next(detail::der_octets);
  TimeStamp stamp{{}, *utc};
  if (!algorithm || !detail::is_object(detail::DerReader(*algorithm).next(detail::der_object), sha256) || !digest ||
      digest->size() != stamp.digest.size())
    return fail("is not of a SHA-256", "ask the authority for a stamp of the claim's SHA-256");
  std::copy(digest->begin(), digest->end(), stamp.digest.begin());
  return stamp;
}

}  // namespace compmark
