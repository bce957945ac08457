// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/proof.hpp.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/app/proof.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/read_file.hpp"
#include "compmark/io/splat/read_splat.hpp"
#include "compmark/io/time_stamp.hpp"
#include "compmark/watermark/proof/shipped_decoders.hpp"

namespace compmark {

COMPMARK_APP_INLINE Result<OwnerClaim> make_claim(const OwnerKey& key, const ClaimSettings& settings) {
  OwnerClaim claim;
  claim.key = key.commitment();
  // The digests are those of the bytes that were looked at.
  if (const Result<FileDecoder> decoder = open_decoder(settings.decoder, &key, &claim.decoder); !decoder)
    return decoder.error();
  if (!settings.interference.empty()) {
    const Result<CoverInterference> said =
        open_interference(settings.interference, settings.decoder, &key, &claim.interference);
    if (!said) return said.error();
  }
  if (const FileKind kind = settings.unmarked.empty() ? FileKind::model : identify_file(settings.unmarked);
      kind != FileKind::model && kind != FileKind::cmk && !is_splat_file(settings.unmarked))
    return wrong_kind(kind, settings.unmarked.string(), "a model");
  if (!settings.unmarked.empty()) {  // a damaged one could never be subtracted
    ThreadExecutor alone(1);
    if (const Result<AnyModel> model = AnyModel::open(settings.unmarked, alone, &claim.unmarked); !model)
      return model.error();
  }
  return claim;
}

COMPMARK_APP_INLINE Result<ProofBasis> proof_basis(const OwnerKey& key, const ReportSources& sources,
                                                   const ProofSettings& settings) {
  ProofBasis basis;
  basis.keys_to_try = keys_a_cheat_could_try(key);
  basis.decoder_shipped = shipped_decoder_of(sources.decoder_sha256).has_value();
  basis.decoder_bound = !key.decoder.empty() && key.decoder == sources.decoder_sha256;
  basis.subtracts = !sources.unmarked.empty() || !sources.interference.empty();
  basis.subtracts_file = !sources.interference.empty();
  if (settings.claim.empty()) {
    if (settings.time_stamp.empty()) return basis;
    return Error{ErrorKind::invalid, settings.time_stamp.string(), "--time-stamp", "is given without a claim",
                 "give the file that it stamps with --claim"};
  }
  const Result<OwnerClaim> claim = read_claim(settings.claim);
  if (!claim) return claim.error();
  if (claim->key != key.commitment()) {
    return Error{ErrorKind::invalid, settings.claim.string(), "key", "is not the commitment of this key",
                 "give the claim that was made with this key"};
  }
  basis.claimed = true;
  basis.claim_sha256 = to_hex(claim->digest());
  basis.decoder_claimed = claim->decoder == sources.decoder_sha256;
  basis.subtracted_claimed = claim->unmarked == sources.unmarked_sha256 || sources.unmarked.empty();
  if (!sources.interference.empty() && claim->interference != sources.interference_sha256)
    basis.subtracted_claimed = false;
  if (settings.time_stamp.empty()) return basis;
  constexpr std::size_t limit = std::size_t{1} << 20;
  const Result<std::vector<std::byte>> bytes = read_file(settings.time_stamp, limit);
  if (!bytes) return bytes.error();
  const Result<TimeStamp> stamp = read_time_stamp(*bytes, settings.time_stamp.string());
  if (!stamp) return stamp.error();
  if (stamp->digest != claim->digest()) {
    return Error{ErrorKind::invalid, settings.time_stamp.string(), "", "stamps another file than the claim",
                 "give the answer to the request that was made of " + settings.claim.string()};
  }
  basis.dated = stamp->time;
  return basis;
}

}  // namespace compmark
