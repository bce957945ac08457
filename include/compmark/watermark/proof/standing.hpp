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

#include "compmark/io/number_text.hpp"
#include "compmark/watermark/proof/ecc.hpp"
#include "compmark/watermark/proof/key.hpp"
#include "compmark/watermark/proof/message.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/shipped_decoders.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// Where key, decoder and what is subtracted come from.
struct ProofBasis {
  bool decoder_shipped = false;     ///< shipped_decoder_of its SHA-256
  bool claimed = false;             ///< a claim names the key
  bool decoder_claimed = false;     ///< … and the decoder
  bool decoder_bound = false;       ///< the key is bound to this decoder (make_bound_key)
  bool subtracts = false;           ///< an unmarked model or its interference is subtracted
  bool subtracted_claimed = false;  ///< … and the claim names it
  std::string claim_sha256;         ///< of the claim; empty: none
  std::string dated;                ///< UTC of its time stamp; empty: none
  bool subtracts_file = false;      ///< … and a file of what the scene says is among it (--interference)
  double keys_to_try = 1;           ///< readings by which a cheat could have tried keys (keys_a_cheat_could_try)
};

enum class StandingKind : std::uint8_t {
  none,         ///< nothing was detected
  not_a_proof,  ///< detected, but somebody could have made it so
  evidence,     ///< with a shipped decoder, and better than any key that could have been tried
  conditional,  ///< a claim names key and decoder; a proof if its reason holds, which no file here shows
  proof,        ///< and a time stamp dates the claim, and the decoder is one that nobody made for this key
};

struct Standing {
  StandingKind kind = StandingKind::none;
  std::string reason{};  ///< a sentence without its full stop; empty where nothing was detected
  double p_tried = 1;    ///< p-value for as many keys as could have been tried
};

/// The largest p-value, corrected, that is called a proof or evidence, whatever rate was accepted.
inline constexpr double proof_p_limit = 1e-3;

/// How many readings a year of one processor core tries: keys a second (a quick key: six compressions of SHA-256, of
/// which OpenSSL does 14 million; scrypt at the usual hardness: 1.6 measured, half with each step), each read by every
/// shipped decoder of its length, or by the one that it is bound to, and as many messages as a payload has values. Of
/// keys before version 5 one derivation gives the messages of all lengths, with every code or none, so that all of those
/// are counted.
template <SecretKey K>
[[nodiscard]] double keys_a_cheat_could_try(const K& key) {
  constexpr double seconds_a_year = 31'557'600, quick_keys_a_second = 2.4e6, hard_keys_a_second = 1.6;
  double tried = seconds_a_year * quick_keys_a_second;
  if constexpr (requires { key.hardness; }) {
    if (key.hardness != 0)
      tried = seconds_a_year * hard_keys_a_second * std::exp2(17 - static_cast<double>(key.hardness));
  }
  bool one_length = false, one_decoder = false;
  if constexpr (requires { key.decoder; }) one_decoder = !key.decoder.empty();
  if constexpr (requires { key.version(); }) one_length = key.version() >= 5;
  const auto decoders = [&](std::size_t bits) { return one_decoder ? 1 : shipped_decoders_reading(bits); };
  if (one_length) {
    tried *= static_cast<double>(std::max<std::size_t>(1, decoders(key.bits)));
  } else {
    // Any length up to the longest, and codes that correct 1 to 15 bits, or none (ecc.hpp).
    constexpr std::size_t codes = 16;
    std::size_t ways = 0;
    for (std::size_t bits = 1; bits <= message_bits_limit; ++bits) ways += codes * decoders(bits);
    tried *= static_cast<double>(ways);
  }
  // One derivation gives the messages of all copies, and a cheat may say any number N of them afterwards: the best of
  // 2 p_shared and 2 N p_N over N up to 100,000, and of the message without recipients, is at most a with a probability
  // below a (1/2 + 1/4 + 1/6 + … + 1/200,000 + 1) < 7.3 a.
  if constexpr (requires { key.recipients; }) {
    if (key.recipients != 0 || !one_length) tried *= 8;
  }
  if constexpr (PayloadKey<K>) {
    if (key.corrects != 0) {
      if (const Result<PayloadCode> code = payload_code(key); code)
        tried *= std::exp2(static_cast<double>(code->data_bits()));
    }
  }
  return tried;
}

[[nodiscard]] inline Standing standing_of(const Verification& verification, const ProofBasis& basis) {
  Standing standing;
  // A claim of another decoder is no claim of this reading.
  const bool claimed = basis.claimed && basis.decoder_claimed;
  // A decoder of the owner's can say one message of every picture, so keys could have been tried on it before anything
  // was claimed. Bound to it, each trial cost a derivation, and as many as could be made are counted, claimed or not.
  const bool bound = basis.decoder_bound && !basis.decoder_shipped;
  standing.p_tried = std::fmin(1, verification.p_corrected * (claimed && !bound ? 1 : basis.keys_to_try));
  const bool tried = standing.p_tried > std::fmin(verification.settings.false_positive_rate, proof_p_limit);
  if (verification.verdict != Verdict::detected) return standing;
  standing.kind = StandingKind::not_a_proof;
  if (!basis.decoder_shipped && !claimed && !bound) {
    standing.reason =
        "this decoder could have been made for these pictures: it is none of those that come with the library, and no "
        "claim names it";
  } else if (basis.subtracts && !basis.subtracted_claimed) {
    standing.reason =
        "what is subtracted could have been made for this message: no claim names it, or not all that is subtracted";
  } else if (verification.p_corrected > proof_p_limit) {
    standing.reason = "chance reads as much with probability " + detail::short_number(verification.p_corrected) +
                      ": the rate that was accepted is too high for a proof";
  } else if (!claimed && tried) {
    standing.reason = "somebody could have tried keys until one matched: a year of one processor core tries " +
                      detail::short_number(basis.keys_to_try) +
                      " of this kind, of which one matches as well with probability " +
                      detail::short_number(standing.p_tried) + ", and no claim names this key with this decoder";
  } else if (!claimed) {
    standing.kind = StandingKind::evidence;
    standing.reason = "no claim dates this key and decoder. Were " + detail::short_number(basis.keys_to_try) +
                      " keys tried, a year of one processor core, one would match as well with probability " +
                      detail::short_number(standing.p_tried) +
                      "; and nobody may have chosen these pictures among others";
  } else {
    // Older than the scene: who has seen it can make an "unmarked" model of it, or try keys on it.
    standing.kind = basis.dated.empty() ? StandingKind::conditional : StandingKind::proof;
    standing.reason = basis.dated.empty()
                          ? "if the claim was published before anybody else had anything that shows this scene: look "
                            "its SHA-256 up where it was"
                          : "if " + basis.dated +
                                " is before anybody else had anything that shows this scene, and the signature of the "
                                "time stamp holds: openssl ts -verify checks it";
    // A file that was made after the key can hold its message (a bias); a date of key and file together does not tell.
    const bool decoder_chosen = !basis.decoder_shipped && (!bound || tried);
    if (decoder_chosen || basis.subtracts_file) {
      standing.kind = StandingKind::conditional;
      standing.reason += std::string("; and if ") +
                         (decoder_chosen ? "the decoder" : "the file of what the scene says") +
                         " was made without this key's message: have it made again, or find it in an older claim";
    }
    standing.reason += "; for pictures that the accuser neither made nor chose";
  }
  return standing;
}

[[nodiscard]] constexpr std::string_view standing_name(StandingKind kind) {
  return kind == StandingKind::none          ? "none"
         : kind == StandingKind::not_a_proof ? "not_a_proof"
         : kind == StandingKind::evidence    ? "evidence"
         : kind == StandingKind::conditional ? "conditional"
                                             : "proof";
}

/// The entry "proof" of a report.
template <class Json>
[[nodiscard]] Json standing_json(const Standing& standing, const ProofBasis& basis) {
  Json json;
  json["standing"] = std::string(standing_name(standing.kind));
  json["reason"] = detail::text_or_null<Json>(standing.reason);
  json["decoder"] = basis.decoder_shipped   ? "shipped"
                    : basis.decoder_bound   ? "bound"
                    : basis.decoder_claimed ? "claimed"
                                            : "unknown";
  json["claim"] = {{"sha256", detail::text_or_null<Json>(basis.claim_sha256)},
                   {"dated", detail::text_or_null<Json>(basis.dated)}};
  if (!basis.dated.empty()) json["claim"]["stamp_signature"] = "not checked";  // openssl ts -verify does
  const bool counted = !(basis.claimed && basis.decoder_claimed) || (basis.decoder_bound && !basis.decoder_shipped);
  json["keys_a_cheat_could_try"] = counted ? basis.keys_to_try : 1;
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
    case StandingKind::conditional:
    case StandingKind::proof:
      break;
  }
  text.replace(
      0, std::string_view("DETECTED").size(),
      standing.kind == StandingKind::proof ? "DETECTED, a proof if the time stamp holds" : "DETECTED, conditionally");
  return text + "standing    a proof " + standing.reason + "\n";
}

/// The report in sentences, its last one with what it proves.
[[nodiscard]] inline std::string report_text(const Verification& verification, const Standing& standing) {
  return evidence_text(verification) + verdict_text(verification, standing);
}

}  // namespace compmark
