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
ProofBasis stamped() {
  ProofBasis basis = claimed();
  basis.dated = "2026-11-28T03:34:28Z";
  basis.claim_sha256 = std::string(64, 'c');
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
  basis.dated = "2026-11-28T03:34:28Z";
  // A decoder that says a message of every picture can be made after the key, and be claimed with it: no date helps.
  standing = standing_of(verified(48), basis);
  CHECK(standing.kind == StandingKind::conditional);
  CHECK(standing.reason.find("if the decoder was made without this key's message") != std::string::npos);
  CHECK(standing_of(verified(24), basis).kind == StandingKind::none);
}

TEST_CASE("watermark/proof/standing: a decoder that the key is bound to was not made for it, if few could be tried") {
  ProofBasis basis;
  basis.decoder_bound = true;
  basis.keys_to_try = std::exp2(27);
  // 48 bits: 2^-48 2^27 = 4.8e-7. Without a claim, evidence as of a shipped decoder.
  CHECK(standing_of(verified(48), basis).kind == StandingKind::evidence);
  CHECK(standing_of(verified(46), basis).kind == StandingKind::not_a_proof);  // 1,177 2^-48 2^27: 5.6e-4
  CHECK(standing_json<nlohmann::json>(standing_of(verified(48), basis), basis)["decoder"] == "bound");
  basis.claimed = basis.decoder_claimed = true;
  basis.dated = "2026-11-28T03:34:28Z";
  CHECK(standing_of(verified(48), basis).kind == StandingKind::proof);
  CHECK(standing_of(verified(48), basis).p_tried == doctest::Approx(std::exp2(-21)));
  // Such a decoder may say one message of every picture: keys could have been tried on it before the claim was made, so
  // that the claim does not do away with their number.
  const Standing tried = standing_of(verified(46), basis);
  CHECK(tried.kind == StandingKind::conditional);
  CHECK(tried.reason.find("if the decoder was made without this key's message") != std::string::npos);
  CHECK(standing_json<nlohmann::json>(tried, basis)["keys_a_cheat_could_try"] == std::exp2(27));
  basis.decoder_bound = false;  // negative control: not bound, the date does not help
  CHECK(standing_of(verified(48), basis).kind == StandingKind::conditional);
  basis.decoder_shipped = basis.decoder_bound = true;  // a shipped one nobody made for a key, bound or not
  CHECK(standing_of(verified(46), basis).kind == StandingKind::proof);
}

TEST_CASE("watermark/proof/standing: a claim of another decoder is no claim of this reading") {
  ProofBasis basis = stamped();
  basis.decoder_claimed = false;
  CHECK(standing_of(verified(41), basis).kind == StandingKind::not_a_proof);
  CHECK(standing_of(verified(48), basis).kind == StandingKind::evidence);
  CHECK(standing_json<nlohmann::json>(standing_of(verified(48), basis), basis)["keys_a_cheat_could_try"] ==
        std::exp2(27));
}

TEST_CASE("watermark/proof/standing: without a date a claim is a condition, and a file that is subtracted is one too") {
  CHECK(standing_of(verified(48), stamped()).kind == StandingKind::proof);
  CHECK(standing_of(verified(48), claimed()).kind == StandingKind::conditional);
  ProofBasis less = stamped();
  less.subtracts = less.subtracted_claimed = true;
  CHECK(standing_of(verified(48), less).kind == StandingKind::proof);  // an unmarked model, older than the scene
  less.subtracts_file = true;
  const Standing standing = standing_of(verified(48), less);
  CHECK(standing.kind == StandingKind::conditional);
  CHECK(standing.reason.find("if the file of what the scene says was made without") != std::string::npos);
}

TEST_CASE("watermark/proof/standing: no accepted rate makes a proof of what chance does often") {
  VerifySettings settings;
  settings.false_positive_rate = 0.5;
  const Message message = Message::from_hex("0123456789ab", 48).value();
  ViewLogits view{"a", "", std::vector<double>(48)};
  for (std::size_t i = 0; i < 48; ++i) view.logits[i] = (message[i] == (i < 26)) ? 1 : -1;
  const Verification often = verify_message(message, std::array{view}, settings).value();
  CHECK(often.verdict == Verdict::detected);
  const Standing standing = standing_of(often, stamped());
  CHECK(standing.kind == StandingKind::not_a_proof);
  CHECK(standing.reason.find("the rate that was accepted is too high") != std::string::npos);
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
  CHECK(standing_of(verified(41), claimed()).kind == StandingKind::conditional);
  CHECK(standing_of(verified(41), stamped()).kind == StandingKind::proof);
  // All 48: 2^-48 * 2^27 = 2^-21 is below 1e-6; 2^-48 * 2^43 is not.
  const Standing whole = standing_of(verified(48), shipped());
  CHECK(whole.kind == StandingKind::evidence);
  CHECK(whole.p_tried == std::exp2(-21));
  ProofBasis quick = shipped();
  quick.keys_to_try = std::exp2(43);
  CHECK(standing_of(verified(48), quick).kind == StandingKind::not_a_proof);
}

TEST_CASE("watermark/proof/standing: a rate that is accepted makes no proof of what keys could be tried for") {
  // A dated claim of a bound decoder and 48 of 48 bits, of which one key in 9 that could be tried has as many.
  ProofBasis basis = stamped();
  basis.decoder_shipped = false;
  basis.decoder_bound = true;
  basis.keys_to_try = 3e13;
  for (const double rate : {1e-6, 1e-2, 0.9}) {
    CAPTURE(rate);
    Verification lax = verified(48);
    lax.settings.false_positive_rate = rate;
    const Standing standing = standing_of(lax, basis);
    CHECK(standing.p_tried == doctest::Approx(3e13 * std::exp2(-48)));
    CHECK(standing.kind == StandingKind::conditional);
    ProofBasis unclaimed = shipped();
    unclaimed.keys_to_try = 3e13;
    CHECK(standing_of(lax, unclaimed).kind == StandingKind::not_a_proof);
  }
}

TEST_CASE("watermark/proof/standing: a year of one processor core, by the kind of key, and every shipped decoder") {
  Digest256 secret{};
  secret[0] = std::byte{1};
  OwnerKey key = *make_key(secret, "2026-01-31T23:59:59Z", 48);
  CHECK(shipped_decoders_reading(48) == 5);  // four universal ones and the lattice of 48
  CHECK(shipped_decoders_reading(24) == 4);
  CHECK(shipped_decoders_reading(96) == 0);
  // One derivation of a quick key, or of one before version 5, gives the messages of 64 lengths by four decoders and of
  // three by a lattice, each with fifteen codes or none, with recipients or without.
  const double ways = (4 * 64 + 3) * 16 * 8;
  const double quick = keys_a_cheat_could_try(key);
  CHECK(quick == doctest::Approx(ways * 2.4e6 * 31'557'600));
  key.hardness = 17;
  key.before_version_5 = true;
  CHECK(keys_a_cheat_could_try(key) == doctest::Approx(ways * 1.6 * 31'557'600));
  key.decoder = std::string(64, 'a');  // bound to one file, which may read any length
  CHECK(keys_a_cheat_could_try(key) == doctest::Approx(128.0 * 16 * 8 * 1.6 * 31'557'600));
  key.before_version_5 = false;
  CHECK(keys_a_cheat_could_try(key) == doctest::Approx(1.6 * 31'557'600));
  key.decoder.clear();
  const double hard = keys_a_cheat_could_try(key);
  CHECK(hard == doctest::Approx(5 * 1.6 * 31'557'600));
  CHECK(hard * std::exp2(-48) < 1e-6);       // all of 48 bits are evidence without a claim
  CHECK(49 * hard * std::exp2(-48) > 1e-6);  // 47 are not
  CHECK(quick * std::exp2(-48) > 1e-6);
  key.hardness = 18;
  CHECK(keys_a_cheat_could_try(key) == hard / 2);
  key.recipients = 10;  // and any other number could be said afterwards
  CHECK(keys_a_cheat_could_try(key) == 8 * (hard / 2));
  key.recipients = 0;
  key.payload = "5eed";  // 16 bits, each of which is another message of one derivation
  key.corrects = 4;
  CHECK(keys_a_cheat_could_try(key) == hard / 2 * std::exp2(16));
}

TEST_CASE("watermark/proof/standing: the report says it in its last lines and in JSON") {
  const Verification found = verified(48);
  const auto text = [&](const ProofBasis& basis) { return report_text(found, standing_of(found, basis)); };
  CHECK(text(claimed()).find("\nDETECTED, conditionally: ") != std::string::npos);
  CHECK(text(claimed()).find("if the claim was published before anybody else had anything that shows this scene") !=
        std::string::npos);
  const ProofBasis dated = stamped();
  CHECK(text(dated).find("\nDETECTED, a proof if the time stamp holds: ") != std::string::npos);
  CHECK(text(dated).find("if 2026-11-28T03:34:28Z is before anybody else had anything that shows this scene") !=
        std::string::npos);
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
