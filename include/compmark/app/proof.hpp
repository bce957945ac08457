// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a verified message proves against somebody who cheats: claims of owners (io/owner_claim.hpp), their time stamps,
// and the standing of a report (watermark/proof/standing.hpp).
#pragma once

#include <filesystem>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/owner_claim.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/standing.hpp"

namespace compmark {

/// What is claimed. Errors name these fields as the tool's options do ("--decoder").
struct ClaimSettings {
  std::filesystem::path decoder;       ///< that reads the marks of the key
  std::filesystem::path unmarked;      ///< model that verify may subtract, or a matched filter needs; may be empty
  std::filesystem::path interference;  ///< file that verify may subtract; may be empty
};

/// The claim of a key on these files. Error: one is missing, or is something else; a decoder of another length.
[[nodiscard]] Result<OwnerClaim> make_claim(const OwnerKey& key, const ClaimSettings& settings);

/// What is given with a report, to say what it proves; both may be empty.
struct ProofSettings {
  std::filesystem::path claim;
  std::filesystem::path time_stamp;  ///< of the claim's file, as an authority answers (RFC 3161)
};

/// The basis of a report of this key. Error: the claim is of another key, or the time stamp of something else.
[[nodiscard]] Result<ProofBasis> proof_basis(const OwnerKey& key, const ReportSources& sources,
                                             const ProofSettings& settings);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/proof.hpp"
#endif
