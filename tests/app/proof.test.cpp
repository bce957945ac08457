// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The commands are tested by tests/tool/verify.test.cpp; here, what is subtracted.
#include <doctest/doctest.h>

#include <compmark/app/files.hpp>
#include <compmark/app/proof.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <filesystem>
#include <string>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

TEST_CASE("app/proof: a claim names decoder and unmarked model, and a basis what of a report it names") {
  using namespace compmark;
  const testing::ScratchFolder folder("compmark-app-proof");
  ClaimSettings settings;
  settings.decoder = folder.path / "decoder.safetensors";
  settings.unmarked = folder.path / "model.safetensors";
  testing::write_decoder(settings.decoder, 32);
  REQUIRE(
      write_model(settings.unmarked, testing::small_model<recipes::Scaffold>(), testing::small_info("scaffold")).ok());
  const OwnerKey key = testing::small_key(1, 32);
  const Result<OwnerClaim> claim = make_claim(key, settings);
  REQUIRE(claim.ok());
  CHECK(claim->key == key.commitment());
  CHECK(claim->decoder == *file_sha256(settings.decoder));
  CHECK(claim->unmarked == *file_sha256(settings.unmarked));
  CHECK(claim->interference.empty());
  ProofSettings given;
  given.claim = folder.path / "owner.claim";
  REQUIRE(write_claim(given.claim, *claim).ok());

  ReportSources sources;
  sources.decoder_sha256 = claim->decoder;
  ProofBasis basis = *proof_basis(key, sources, given);
  CHECK(basis.claimed);
  CHECK(basis.decoder_claimed);
  CHECK_FALSE(basis.decoder_shipped);
  CHECK_FALSE(basis.subtracts);
  sources.unmarked = "model.safetensors";
  sources.unmarked_sha256 = claim->unmarked;
  basis = *proof_basis(key, sources, given);
  CHECK(basis.subtracts);
  CHECK(basis.subtracted_claimed);
  sources.unmarked_sha256[0] = sources.unmarked_sha256[0] == '0' ? '1' : '0';
  CHECK_FALSE(proof_basis(key, sources, given)->subtracted_claimed);
  sources.unmarked.clear();
  sources.interference = "interference.safetensors";
  sources.interference_sha256 = std::string(64, '0');
  CHECK_FALSE(proof_basis(key, sources, given)->subtracted_claimed);
  CHECK_FALSE(proof_basis(key, sources, {})->claimed);

  CHECK_FALSE(proof_basis(testing::small_key(2, 32), sources, given).ok());
  CHECK_FALSE(make_claim(testing::small_key(1, 48), settings).ok());  // another length
  settings.unmarked = settings.decoder;
  CHECK_FALSE(make_claim(key, settings).ok());
  settings.unmarked.clear();
  settings.interference = settings.decoder;
  CHECK_FALSE(make_claim(key, settings).ok());
}
