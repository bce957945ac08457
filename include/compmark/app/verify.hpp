// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Ownership of files: is the message of this key in a model, or in images, and how likely would that be by chance.
#pragma once

#include <array>

#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/app/reading.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// Reads what the settings name and tests it for the message of the key. The report is for watermark/proof/report.hpp:
/// report_json, report_text. Errors are those of check_settings and of read_messages. Cost: that of reading.
[[nodiscard]] Result<VerificationReport> verify_files(const OwnerKey& key, const ReadingSettings& reading,
                                                      const VerifySettings& settings, ThreadExecutor& executor,
                                                      const WorkObserver& observer = {});

/// The same for images that somebody may have mirrored: they are read as they are and mirrored, and the report is that
/// of the reading with more matches, as they are if both have as many. That is two tests: settings.tries counts twice,
/// in the report too. A model has no mirror image: an error. Cost: twice that of reading.
[[nodiscard]] Result<VerificationReport> verify_either_way(const OwnerKey& key, ReadingSettings reading,
                                                           VerifySettings settings, ThreadExecutor& executor,
                                                           const WorkObserver& observer = {});

/// The shares of a model's anchors that verify_pruned reads it as lacking. 20 % lost are read best as .2 or .35, 50 % as
/// .35 or .5 (docs/notebook/watermark_experiments.md).
inline constexpr std::array<double, 4> pruned_shares{0, 0.2, 0.35, 0.5};

/// The same for a model from which anchors may have been taken: it is read as it is and as lacking each of
/// pruned_shares (AnyModel::make_up_for), and the report is that of the reading with the most matches, of several the one
/// with the most in single views. That is four tests: settings.tries counts four times, in the report too. Error: images
/// are given. Cost: four times that of reading.
[[nodiscard]] Result<VerificationReport> verify_pruned(const OwnerKey& key, ReadingSettings reading,
                                                       VerifySettings settings, ThreadExecutor& executor,
                                                       const WorkObserver& observer = {});

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/verify.hpp"
#endif
