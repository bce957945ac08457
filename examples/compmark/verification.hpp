// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From the options of a verification to its verdict, its report and its lines; for the commands that verify.
#pragma once

#include <compmark/app/informed.hpp>
#include <compmark/app/proof.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "options.hpp"
#include "reading.hpp"

namespace tool {

struct VerifyOptions {
  ReadingOptions reading;
  std::filesystem::path key;
  compmark::ProofSettings proof;
  bool any_decoder = false;
  bool mirrored = false;
  bool pruned = false;
  double alpha = 1e-6;
  double recipient_alpha = compmark::VerifySettings{}.recipient_rate;
  std::uint64_t tests = 1;
};

/// What was found, and what it proves.
struct Verified {
  compmark::OwnerKey key;
  compmark::VerificationReport report;               ///< of the message
  std::optional<compmark::InformedReport> informed;  ///< its report is the one above
  compmark::Verification verdict;                    ///< of message and spread mark together; else the report's
  compmark::ProofBasis basis;
  compmark::Standing standing;
  std::optional<PayloadText> payload;
};

/// --key, those of a reading, --alpha, --recipient-alpha, --tests, --mirrored, --pruned, --restored, --up, --claim, --time-stamp, --any-decoder
void add_verify_options(Options& app, const std::shared_ptr<VerifyOptions>& options);

/// Verifies as the options say. `compared` is told of every picture whose camera an informed reading found.
compmark::Result<Verified> verify_by(const VerifyOptions& options, const compmark::ComparedObserver& compared = {});

/// The report of verify --json.
nlohmann::ordered_json verified_json(const Verified& verified);
/// What verify prints, its last line the verdict.
std::string verified_text(const Verified& verified);
/// 0 detected, 1 not, 3 inconclusive or no proof.
int verified_code(const Verified& verified);

}  // namespace tool
