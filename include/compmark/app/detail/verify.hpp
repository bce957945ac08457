// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/verify.hpp.
#pragma once

#include <cstddef>
#include <optional>
#include <utility>

#include "compmark/app/detail/reading.hpp"
#include "compmark/app/verify.hpp"
#include "compmark/watermark/proof/recipients.hpp"

namespace compmark {
namespace detail {

/// Whether more of the message was read in `one` than in `other`, of the same key.
[[nodiscard]] inline bool reads_better(const VerificationReport& one, const VerificationReport& other) {
  const Evidence &better = one.verification.evidence, &worse = other.verification.evidence;
  // With recipients the matches are those of the nearest copy, and the p-value decides.
  return one.verification.recipients ? better.p_value < worse.p_value : better.matches > worse.matches;
}

/// Matches of all views, each by itself.
[[nodiscard]] inline std::size_t matches_in_views(const VerificationReport& report) {
  std::size_t sum = 0;
  for (const Evidence& view : report.verification.views) sum += view.matches;
  return sum;
}
/// … and if neither reads better together, more of it in single views.
[[nodiscard]] inline bool reads_better_or_more(const VerificationReport& one, const VerificationReport& other) {
  if (reads_better(one, other)) return true;
  return !reads_better(other, one) && matches_in_views(one) > matches_in_views(other);
}

}  // namespace detail

COMPMARK_APP_INLINE Result<VerificationReport> verify_files(const OwnerKey& key, const ReadingSettings& reading,
                                                            const VerifySettings& settings, ThreadExecutor& executor,
                                                            const WorkObserver& observer) {
  if (const Result<Done> checked = check_settings(settings); !checked) return checked.error();
  Result<Reading> read = read_messages(reading, key, executor, observer);
  if (!read) return read.error();
  Result<Verification> verification = verify_key(key, read->views, settings);
  if (!verification) return verification.error();
  VerificationReport report{std::move(read->sources), std::move(read->views), std::move(*verification)};
  report.restored = read->restored;
  return report;
}

COMPMARK_APP_INLINE Result<VerificationReport> verify_either_way(const OwnerKey& key, ReadingSettings reading,
                                                                 VerifySettings settings, ThreadExecutor& executor,
                                                                 const WorkObserver& observer) {
  if (!reading.model.empty()) {
    return Error{ErrorKind::invalid, reading.model.string(), "--mirrored", "is for images, and this is a model",
                 "leave it out, or render the model and give --images"};
  }
  if (const Result<Done> checked = check_settings(settings, 2); !checked) return checked.error();
  settings.tries *= 2;
  reading.mirrored = false;
  Result<VerificationReport> report = verify_files(key, reading, settings, executor, observer);
  if (!report) return report;
  reading.mirrored = true;
  Result<VerificationReport> mirrored = verify_files(key, reading, settings, executor, observer);
  if (!mirrored) return mirrored;
  report->mirrored = false;
  mirrored->mirrored = true;
  return detail::reads_better(*mirrored, *report) ? mirrored : report;
}

COMPMARK_APP_INLINE Result<VerificationReport> verify_pruned(const OwnerKey& key, ReadingSettings reading,
                                                             VerifySettings settings, ThreadExecutor& executor,
                                                             const WorkObserver& observer) {
  if (reading.model.empty()) {
    return Error{
        ErrorKind::invalid, {}, "--pruned", "is for a model, and these are images", "leave it out, or give --model"};
  }
  if (const Result<Done> checked = check_settings(settings, pruned_shares.size()); !checked) return checked.error();
  settings.tries *= pruned_shares.size();
  std::optional<VerificationReport> best;
  for (const double share : pruned_shares) {
    reading.missing_share = share;
    Result<VerificationReport> report = verify_files(key, reading, settings, executor, observer);
    if (!report) return report;
    report->missing_share = share;
    if (!best || detail::reads_better_or_more(*report, *best)) best = std::move(*report);
  }
  return std::move(*best);
}

}  // namespace compmark
