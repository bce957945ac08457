// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Verification with a key of several recipients (recipient_code.hpp). Two questions, two null hypotheses.
//
// Is it the owner's? Null hypothesis: the key was drawn at random, independently of the images. Two tests share the
// rate: of the shared bits, and of the whole message of the nearest of N copies. Under the mask each copy's message is as
// random as a key's, so that matches are fair coins, and both weighted sums (recipient_score.hpp) have exact p-values:
// p = min(2 p_shared, 2 N p_copy). The first stays where copies are averaged, the second is stronger where one leaked.
//
// Whose copy is it? Null hypothesis of recipient j: he had no part, so that his word is independent of what was read.
// p_j is exact (recipient_score.hpp), and is multiplied by N: somebody who had no part is named with a probability of at
// most the rate. Cost: 5 us a recipient and 5 ms for the distribution.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/watermark/proof/key.hpp"
#include "compmark/watermark/proof/recipient_code.hpp"
#include "compmark/watermark/proof/recipient_score.hpp"
#include "compmark/watermark/proof/recipient_trace.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

namespace detail {

/// The score of a message at some places.
[[nodiscard]] inline std::int64_t score_of(const Message& message, const Message& read,
                                           std::span<const std::size_t> places, std::span<const ScoreTerm> terms) {
  std::int64_t score = 0;
  for (std::size_t i = 0; i < places.size(); ++i)
    score += message[places[i]] == read[places[i]] ? terms[i].match : terms[i].mismatch;
  return score;
}

}  // namespace detail

/// What fused logits, one a bit, finite, say of the recipients of a key; `named` are all whose p-value is low enough for
/// `rate` and `tries`, whether the owner is proven or not. The key passes check_recipients.
template <RecipientKey K>
[[nodiscard]] RecipientTrace trace_recipients(const K& key, std::span<const double> fused, double rate,
                                              std::uint64_t tries = 1) {
  const RecipientCode code(key);
  const Message read = Message::from_logits<double>(fused), nobody = code.message(key, 0);
  const std::vector<double> weights = bit_weights(fused, code.shared());
  RecipientTrace trace;
  trace.recipients = key.recipients;
  trace.rate = rate;
  trace.shared_bits = code.shared().size();
  trace.naming_bits = code.naming().size();
  std::vector<ScoreTerm> shared, naming;
  for (const std::size_t place : code.shared()) {
    trace.shared_matches += nobody[place] == read[place] ? 1 : 0;
    shared.push_back(symmetric_term(0.5, weights[place]));
  }
  for (const std::size_t place : code.naming()) {
    naming.push_back(symmetric_term(0.5, weights[place]));
    trace.undecided += weights[place] <= 0.25 ? 1 : 0;
  }
  const std::int64_t shared_score = detail::score_of(nobody, read, code.shared(), shared);
  trace.shared_p_value = ScoreTail(shared)(shared_score);
  const ScoreTail tail(naming);
  const double count = static_cast<double>(key.recipients) * static_cast<double>(tries);
  std::int64_t highest = 0;
  std::vector<std::pair<std::int64_t, RecipientEvidence>> found;
  for (std::size_t number = 1; number <= key.recipients; ++number) {
    const Message message = code.message(key, number);
    const std::int64_t score = detail::score_of(message, read, code.naming(), naming);
    const double p = tail(score);
    const bool nearest = number == 1 || score > highest, low = p * count <= rate;
    if (!nearest && !low) continue;
    // All copies have the shared bits.
    const std::size_t matches = message.matches(read) - trace.shared_matches;
    const RecipientEvidence evidence{number, matches, p, std::fmin(1, p * count)};
    if (nearest) trace.nearest = evidence, highest = score;
    if (low) found.emplace_back(score, evidence);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  for (const auto& [score, evidence] : found) trace.named.push_back(evidence);
  // The message of the nearest copy, all of its bits.
  shared.insert(shared.end(), naming.begin(), naming.end());
  trace.copy_p_value = ScoreTail(shared)(highest + shared_score);
  return trace;
}

/// Tests a key against the logits of one or more views: verify_message of its message or, with recipients, both
/// questions. Then `evidence` has the matches of the nearest copy's message and the p-value of both tests together,
/// `views` the matches with that message and their p-values times the number of copies, for information, and `threshold`
/// what it takes by the matches of one copy alone.
template <SecretKey K>
[[nodiscard]] Result<Verification> verify_key(const K& key, std::span<const ViewLogits> views,
                                              const VerifySettings& settings = {}) {
  if constexpr (RecipientKey<K>) {
    if (key.recipients != 0) {
      if (const Result<Done> fits = check_recipients(key.bits, key.recipients); !fits) return fits.error();
      const RecipientCode code(key);
      Result<Verification> read = verify_message(code.message(key, 0), views, settings);
      if (!read) return read;
      RecipientTrace trace = trace_recipients(key, read->fused, settings.recipient_rate, settings.tries);
      Result<Verification> result = verify_message(code.message(key, trace.nearest.number), views, settings);
      if (!result) return result;
      const double copies = static_cast<double>(key.recipients);
      for (Evidence& view : result->views) view.p_value = std::fmin(1, copies * view.p_value);  // the nearest of all
      result->evidence.p_value = std::fmin(1, std::fmin(2 * trace.shared_p_value, 2 * copies * trace.copy_p_value));
      result->p_corrected = std::fmin(1, result->evidence.p_value * static_cast<double>(settings.tries));
      result->threshold =
          match_threshold(result->bits, rate_per_try(settings.false_positive_rate, settings.tries) / (2 * copies));
      // Where not even all bits would be enough, nothing is said against the key (as verify_message has it).
      const double least = 2 * std::fmin(std::exp2(-static_cast<double>(trace.shared_bits)),
                                         copies * std::exp2(-static_cast<double>(result->bits)));
      const bool reachable = least * static_cast<double>(settings.tries) <= settings.false_positive_rate;
      result->verdict = result->p_corrected <= settings.false_positive_rate       ? Verdict::detected
                        : !reachable || result->p_corrected <= settings.suspicion ? Verdict::inconclusive
                                                                                  : Verdict::not_detected;
      trace.owner_proven = result->verdict == Verdict::detected;
      result->recipients = std::move(trace);
      return result;
    }
  }
  return verify_message(message_of(key), views, settings);
}

}  // namespace compmark
