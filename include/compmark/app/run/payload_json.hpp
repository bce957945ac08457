// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The payload of a key, as it was read from a message, for verification.json.
#pragma once

#include <nlohmann/json.hpp>

#include "compmark/io/owner_key.hpp"
#include "compmark/watermark/proof/key.hpp"
#include "compmark/watermark/proof/message.hpp"

namespace compmark {

/// What a payload code reads in a message, as verification.json has it.
[[nodiscard]] inline nlohmann::ordered_json payload_json(const OwnerKey& key, const Message& read) {
  const PayloadCode::Reading reading = read_payload(key, read);
  const bool whole = reading.outcome == PayloadCode::Outcome::read;
  const char* const outcome = whole                                                 ? "read"
                              : reading.outcome == PayloadCode::Outcome::crc_failed ? "crc_failed"
                                                                                    : "too_many_errors";
  // The probability that random bits pass BCH and the CRC: a payload alone is no evidence.
  const double chance = payload_code(key)->code.random_decode_rate() / 256;
  return {{"outcome", outcome},
          {"hex", whole ? nlohmann::ordered_json(reading.data.hex()) : nlohmann::ordered_json(nullptr)},
          {"corrected", whole ? nlohmann::ordered_json(reading.corrected) : nlohmann::ordered_json(nullptr)},
          {"chance", chance}};
}

}  // namespace compmark
