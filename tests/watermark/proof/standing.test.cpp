// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a detection proves against somebody who cheats: each way of cheating ends in "not a proof" with its reason.
#include <doctest/doctest.h>

#include <array>
#include <compmark/io/owner_key.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/standing.hpp>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

using namespace compmark;

namespace standing_test {
namespace {

/// A verification of 48 bits of which `matches` are right.
Verification verified(std::size_t matches) {
  const Message message = Message::from_hex("0123456789ab", 48).value();
  ViewLogits view{"a", "", std::vector<double>(48)};
  for (std::size_t i = 0; i < 48; ++i) view.logits[i] = (message[i] == (i < matches)) ? 1 : -1;
  return verify_message(message, std::array{view}).value();
}

ProofBasis shipped() {
  ProofBasis basis;
  basis.decoder_shipped = true;
  basis.keys_to_try = std::exp2(27);
  return basis;
}
ProofBasis claimed() {
  ProofBasis basis = shipped();
  basis.claimed = basis.decoder_claimed = true;
  return basis;
}

}  // namespace

TEST_CASE("watermark/proof/standing: an unknown decoder proves nothing, whatever it reads") {
  ProofBasis basis;
  Standing standing = standing_of(verified(48), basis);
  CHECK(standing.kind == StandingKind::not_a_proof);
  CHECK(standing.reason.find("this decoder could have been made for these pictures") == 0);
  basis.claimed = true;  // of the key and another decoder
  CHECK(standing_of(verified(48), basis).kind == StandingKind::not_a_proof);
  basis.decoder_claimed = true;
  CHECK(standing_of(verified(48), basis).kind == StandingKind::proof);
  CHECK(standing_of(verified(24), basis).kind == StandingKind::none);
}

TEST_CASE("watermark/proof/standing: what is subtracted has to be claimed") {
  for (ProofBasis basis : {shipped(), claimed()}) {
    basis.subtracts = true;
    const Standing standing = standing_of(verified(48), basis);
    CHECK(standing.kind == StandingKind::not_a_proof);
    CHECK(standing.reason.find("what is subtracted could have been made") == 0);
    basis.subtracted_claimed = true;
    CHECK(standing_of(verified(48), basis).kind != StandingKind::not_a_proof);
  }
}

TEST_CASE("watermark/proof/standing: keys that could have been tried are counted, and a claim ends the count") {
  // 41 of 48 are detected, p = 3.1e-7; of 2^27 keys, some match as well.
  const Standing ground = standing_of(verified(41), shipped());
  CHECK(verified(41).verdict == Verdict::detected);
  CHECK(ground.kind == StandingKind::not_a_proof);
  CHECK(ground.p_tried == 1);
  CHECK(ground.reason.find("somebody could have tried keys until one matched") == 0);
  CHECK(standing_of(verified(41), claimed()).kind == StandingKind::proof);
  // All 48: 2^-48 * 2^27 = 2^-21 is below 1e-6; 2^-48 * 2^43 is not.
  const Standing whole = standing_of(verified(48), shipped());
  CHECK(whole.kind == StandingKind::evidence);
  CHECK(whole.p_tried == std::exp2(-21));
  ProofBasis quick = shipped();
  quick.keys_to_try = std::exp2(43);
  CHECK(standing_of(verified(48), quick).kind == StandingKind::not_a_proof);
}

TEST_CASE("watermark/proof/standing: a year of one processor, by the kind of key") {
  Digest256 secret{};
  secret[0] = std::byte{1};
  OwnerKey key = *make_key(secret, "2026-01-31T23:59:59Z", 48);
  CHECK(keys_a_cheat_could_try(key) == std::exp2(43));
  key.hardness = 17;
  CHECK(keys_a_cheat_could_try(key) == std::exp2(27));
  key.hardness = 18;
  CHECK(keys_a_cheat_could_try(key) == std::exp2(26));
  key.payload = "5eed";  // 16 bits, each of which is another message of one derivation
  key.corrects = 4;
  CHECK(keys_a_cheat_could_try(key) == std::exp2(26 + 16));
}

TEST_CASE("watermark/proof/standing: the report says it in its last lines and in JSON") {
  const Verification found = verified(48);
  const auto text = [&](const ProofBasis& basis) { return report_text(found, standing_of(found, basis)); };
  CHECK(text(claimed()).find("\nDETECTED, a proof: ") != std::string::npos);
  CHECK(text(claimed()).find("saw the claim published") != std::string::npos);
  ProofBasis dated = claimed();
  dated.dated = "2026-11-28T03:34:28Z";
  dated.claim_sha256 = std::string(64, 'c');
  CHECK(text(dated).find("2026-11-28T03:34:28Z is older") != std::string::npos);
  CHECK(text(shipped()).find("\nDETECTED: ") != std::string::npos);
  CHECK(text(shipped()).find("\nstanding    evidence; ") != std::string::npos);
  CHECK(text({}).find("DETECTED") == std::string::npos);
  CHECK(text({}).find("\nNOT A PROOF: ") != std::string::npos);
  const Verification none = verified(24);
  CHECK(report_text(none, standing_of(none, claimed())) == report_text(none));
  const auto json = standing_json<nlohmann::json>(standing_of(found, dated), dated);
  CHECK(json["standing"] == "proof");
  CHECK(json["claim"]["dated"] == dated.dated);
  CHECK(json["keys_a_cheat_could_try"] == 1);
  CHECK(standing_json<nlohmann::json>(standing_of(found, {}), {})["standing"] == "not_a_proof");
  CHECK(standing_json<nlohmann::json>(standing_of(none, {}), {})["reason"].is_null());
}

}  // namespace standing_test
