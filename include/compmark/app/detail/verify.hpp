// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/verify.hpp.
#pragma once

#include <utility>

#include "compmark/app/detail/reading.hpp"
#include "compmark/app/verify.hpp"
#include "compmark/watermark/proof/recipients.hpp"

namespace compmark {

COMPMARK_APP_INLINE Result<VerificationReport> verify_files(const OwnerKey& key, const ReadingSettings& reading,
                                                            const VerifySettings& settings, ThreadExecutor& executor,
                                                            const WorkObserver& observer) {
  if (const Result<Done> checked = check_settings(settings); !checked) return checked.error();
  Result<Reading> read = read_messages(reading, key, executor, observer);
  if (!read) return read.error();
  Result<Verification> verification = verify_key(key, read->views, settings);
  if (!verification) return verification.error();
  return VerificationReport{std::move(read->sources), std::move(read->views), std::move(*verification)};
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
  const Evidence &as_is = report->verification.evidence, &turned = mirrored->verification.evidence;
  // With recipients the matches are those of the nearest copy, and the p-value decides.
  const bool by_p = report->verification.recipients.has_value();
  return (by_p ? turned.p_value < as_is.p_value : turned.matches > as_is.matches) ? mirrored : report;
}

}  // namespace compmark
