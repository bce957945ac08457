// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a report says of a key with recipients, as JSON and as sentences (report.hpp has the rest of it).
#pragma once

#include <array>
#include <cstdio>
#include <string>

#include "compmark/io/number_text.hpp"
#include "compmark/watermark/proof/recipient_trace.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// The entry "recipients" of a report: what recipients.hpp finds.
template <class Json>
[[nodiscard]] Json recipients_json(const RecipientTrace& trace) {
  const auto of = [](const RecipientEvidence& one) {
    Json json{{"recipient", one.number}, {"matches", one.matches}};
    json["p_value"] = one.p_value, json["p_corrected"] = one.p_corrected;
    return json;
  };
  Json json;
  json["number"] = trace.recipients;
  json["shared"] = {{"bits", trace.shared_bits}, {"matches", trace.shared_matches}, {"p_value", trace.shared_p_value}};
  json["copy"] = {{"recipient", trace.nearest.number}, {"p_value", trace.copy_p_value}};
  json["naming"] = {{"bits", trace.naming_bits},
                    {"undecided", trace.undecided},
                    {"false_name_rate", trace.rate},
                    {"correction", "Bonferroni"}};
  json["nearest"] = of(trace.nearest);
  json["named"] = Json::array();
  if (trace.owner_proven) {
    for (const RecipientEvidence& one : trace.named) json["named"].push_back(of(one));
  }
  return json;
}

namespace detail {

/// The lines of a report on the bits that all copies share, and on the nearest copy.
[[nodiscard]] inline std::string owner_lines(const Verification& v) {
  const RecipientTrace& trace = *v.recipients;
  return "shared      " + std::to_string(trace.shared_matches) + " of the " + std::to_string(trace.shared_bits) +
         " bits that all copies share match, p " + short_number(trace.shared_p_value) +
         "\ncopy        the nearest of " + std::to_string(trace.recipients) + " is that of recipient " +
         std::to_string(trace.nearest.number) + ": " + std::to_string(v.evidence.matches) + " of all " +
         std::to_string(v.bits) + " bits, p " + short_number(trace.copy_p_value) +
         " before it is corrected for all copies; clear bits count more\np-value     " +
         short_number(v.evidence.p_value) +
         ": so likely a key drawn at random, without knowing the images and the decoder, would match at least as well,"
         " by its shared bits or by any copy's message\n";
}
/// Whose copy it is.
[[nodiscard]] inline std::string recipient_lines(const Verification& v) {
  const RecipientTrace& trace = *v.recipients;
  if (!trace.owner_proven) return "recipient   nobody is named where the owner's mark is not detected\n";
  const std::string corrected =
      std::to_string(trace.recipients) + " recipients" +
      (v.settings.tries > 1 ? " and " + std::to_string(v.settings.tries) + " tests " : std::string(" "));
  std::string text, rate = short_number(trace.rate);
  for (const RecipientEvidence& one : trace.named) {
    text += "recipient   " + std::to_string(one.number) + ": " + std::to_string(one.matches) + " of the " +
            std::to_string(trace.naming_bits) + " bits that name recipients, p " + short_number(one.p_value) +
            "; corrected for " + corrected + short_number(one.p_corrected) + ", at most " + rate +
            " for anybody who had no part\n";
  }
  if (text.empty()) {
    text = "recipient   no single recipient can be named at a rate of " + rate + ": the nearest, " +
           std::to_string(trace.nearest.number) + ", has a corrected p of " + short_number(trace.nearest.p_corrected) +
           "\n";
  }
  if (4 * trace.undecided >= trace.naming_bits) {
    text += "undecided   " + std::to_string(trace.undecided) + " of the " + std::to_string(trace.naming_bits) +
            " bits that name recipients: copies may have been mixed, or the mark is weak\n";
  }
  return text;
}
}  // namespace detail

}  // namespace compmark
