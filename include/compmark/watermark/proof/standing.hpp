// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a detection proves against somebody who cheats (docs/threat_model.md). Its p-value is that of a key drawn at
// random, independently of the pictures and of the decoder. Who chooses the decoder, what is subtracted, or one of
// many keys after a look at the pictures gets any p-value he likes: so each of them must be shipped with the library or
// named in a claim that was published before, or the verdict must hold for as many keys as he could have tried.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "compmark/watermark/proof/ecc.hpp"
#include "compmark/watermark/proof/key.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// Where key, decoder and what is subtracted come from.
struct ProofBasis {
  bool decoder_shipped = false;     ///< shipped_decoder_of its SHA-256
  bool claimed = false;             ///< a claim names the key
  bool decoder_claimed = false;     ///< … and the decoder
  bool subtracts = false;           ///< an unmarked model or its interference is subtracted
  bool subtracted_claimed = false;  ///< … and the claim names it
  std::string claim_sha256;         ///< of the claim; empty: none
  std::string dated;                ///< UTC of its time stamp; empty: none
  double keys_to_try = 1;           ///< keys of this kind that a cheat could have tried (keys_a_cheat_could_try)
};

enum class StandingKind : std::uint8_t {
  none,         ///< nothing was detected
  not_a_proof,  ///< detected, but somebody could have made it so
  evidence,     ///< with a shipped decoder, and better than any key that could have been tried
  proof,        ///< and a claim names key and decoder: a proof for whom it was published before the pictures were
};

struct Standing {
  StandingKind kind = StandingKind::none;
  std::string reason{};  ///< a sentence without its full stop; empty where nothing was detected
  double p_tried = 1;    ///< p-value for as many keys as could have been tried
};

/// Keys that a year of one processor's time tries: 2^43 of version 1 (0.2 million a second), 2^27 of version 2 at the
/// usual hardness (4 a second; one thread was measured to try 1.6), half with each step. A key with a payload has as
/// many messages as payloads.
template <SecretKey K>
[[nodiscard]] double keys_a_cheat_could_try(const K& key) {
  double log2 = 43;
  if constexpr (requires { key.hardness; }) {
    if (key.hardness != 0) log2 = 44 - static_cast<double>(key.hardness);
  }
  if constexpr (PayloadKey<K>) {
    if (key.corrects != 0) {
      if (const Result<PayloadCode> code = payload_code(key); code) log2 += static_cast<double>(code->data_bits());
    }
  }
  return std::exp2(log2);
}

[[nodiscard]] inline Standing standing_of(const Verification& verification, const ProofBasis& basis) {
  Standing standing;
  standing.p_tried = std::fmin(1, verification.p_corrected * (basis.claimed ? 1 : basis.keys_to_try));
  if (verification.verdict != Verdict::detected) return standing;
  standing.kind = StandingKind::not_a_proof;
  if (!basis.decoder_shipped && !basis.decoder_claimed) {
    standing.reason =
        "this decoder could have been made for these pictures: it is none of those that come with the library, and no "
        "claim names it";
  } else if (basis.subtracts && !basis.subtracted_claimed) {
    standing.reason =
        "what is subtracted could have been made for this message: no claim names it, or not all that is subtracted";
  } else if (!basis.claimed && standing.p_tried > verification.settings.false_positive_rate) {
    standing.reason = "somebody could have tried keys until one matched: a year of one processor tries " +
                      detail::short_number(basis.keys_to_try) +
                      " of this kind, of which one matches as well with probability " +
                      detail::short_number(standing.p_tried) + ", and no claim names this key";
  } else if (!basis.claimed) {
    standing.kind = StandingKind::evidence;
    standing.reason = "no claim dates this key and decoder. Were " + detail::short_number(basis.keys_to_try) +
                      " keys tried, a year of one processor, one would match as well with probability " +
                      detail::short_number(standing.p_tried);
  } else {
    standing.kind = StandingKind::proof;
    standing.reason =
        basis.dated.empty()
            ? "for whoever saw the claim published before these pictures: look its SHA-256 up where it was"
            : "if its time stamp of " + basis.dated +
                  " is older than these pictures: openssl ts -verify checks its signature";
  }
  return standing;
}

[[nodiscard]] constexpr std::string_view standing_name(StandingKind kind) {
  return kind == StandingKind::none          ? "none"
         : kind == StandingKind::not_a_proof ? "not_a_proof"
         : kind == StandingKind::evidence    ? "evidence"
                                             : "proof";
}

/// The entry "proof" of a report.
template <class Json>
[[nodiscard]] Json standing_json(const Standing& standing, const ProofBasis& basis) {
  Json json;
  json["standing"] = std::string(standing_name(standing.kind));
  json["reason"] = detail::text_or_null<Json>(standing.reason);
  json["decoder"] = basis.decoder_shipped ? "shipped" : basis.decoder_claimed ? "claimed" : "unknown";
  json["claim"] = {{"sha256", detail::text_or_null<Json>(basis.claim_sha256)},
                   {"dated", detail::text_or_null<Json>(basis.dated)}};
  json["keys_a_cheat_could_try"] = basis.claimed ? 1 : basis.keys_to_try;
  json["p_value_if_tried"] = standing.p_tried;
  return json;
}

/// The verdict and what it proves, in one line or two.
[[nodiscard]] inline std::string verdict_text(const Verification& verification, const Standing& standing) {
  std::string text = verdict_text(verification);
  switch (standing.kind) {
    case StandingKind::none:
      return text;
    case StandingKind::not_a_proof:
      return "NOT A PROOF: the mark is read, but " + standing.reason + "\n";
    case StandingKind::evidence:
      return text + "standing    evidence; " + standing.reason +
             ". A claim published before (compmark claim) makes it a proof\n";
    case StandingKind::proof:
      break;
  }
  text.replace(0, std::string_view("DETECTED").size(), "DETECTED, a proof");
  return text + "standing    a proof " + standing.reason + "\n";
}

/// The report in sentences, its last one with what it proves.
[[nodiscard]] inline std::string report_text(const Verification& verification, const Standing& standing) {
  return evidence_text(verification) + verdict_text(verification, standing);
}

}  // namespace compmark
