// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/verify.hpp.
#pragma once

#include <utility>

#include "compmark/app/detail/reading.hpp"
#include "compmark/app/verify.hpp"
#include "compmark/watermark/proof/key.hpp"

namespace compmark {

COMPMARK_APP_INLINE Result<VerificationReport> verify_files(const OwnerKey& key, const ReadingSettings& reading,
                                                            const VerifySettings& settings, ThreadExecutor& executor,
                                                            const WorkObserver& observer) {
  if (const Result<Done> checked = check_settings(settings); !checked) return checked.error();
  Result<Reading> read = read_messages(reading, key, executor, observer);
  if (!read) return read.error();
  Result<Verification> verification = verify_message(message_of(key), read->views, settings);
  if (!verification) return verification.error();
  return VerificationReport{std::move(read->sources), std::move(read->views), std::move(*verification)};
}

}  // namespace compmark
