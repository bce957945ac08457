// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark verify: is the message of this key in a model or in images, and how likely would that be by chance.
#include <compmark/app/informed.hpp>
#include <compmark/app/proof.hpp>
#include <compmark/app/run/mark_record.hpp>
#include <compmark/app/verify.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/json_file.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "commands.hpp"
#include "common.hpp"
#include "reading.hpp"
#include "run_folder.hpp"

namespace tool {
namespace {

using namespace compmark;

struct VerifyOptions {
  ReadingOptions reading;
  std::filesystem::path key;
  std::filesystem::path json;
  ProofSettings proof;
  bool any_decoder = false;
  bool mirrored = false;
  double alpha = 1e-6;
  std::uint64_t tests = 1;
};

int run(const VerifyOptions& options) {
  VerifySettings settings;
  settings.false_positive_rate = options.alpha;
  settings.tries = options.tests;
  if (const Result<Done> checked = check_settings(settings); !checked) return fail(checked.error());
  const Result<OwnerKey> key = load_key(options.key);
  if (!key) return fail(key.error());
  // A claim that is not of this key is told before the reading.
  if (const Result<ProofBasis> claimed = proof_basis(*key, {}, options.proof); !claimed) return fail(claimed.error());
  if (!options.any_decoder) {
    const Result<Done> recorded =
        check_recorded(options.key, *key, options.reading.decoder, options.reading.model, print_warning);
    if (!recorded) return fail(recorded.error());
  }
  ThreadExecutor executor(options.reading.threads);
  tell_threads(executor, options.reading.threads);
  const ReadingSettings reading = reading_settings(options.reading);
  std::optional<InformedReport> informed;
  std::optional<VerificationReport> verified;
  if (reading.model.empty() && !reading.unmarked.empty()) {
    if (!reading.interference.empty()) {
      return fail(Error{ErrorKind::invalid, reading.interference.string(), "--interference",
                        "is given with --unmarked, which says more", "leave it out"});
    }
    ReadingSettings either_way = reading;
    either_way.mirrored = options.mirrored;  // which way is found without the key, and counts once
    Result<InformedReport> read = verify_informed(*key, either_way, settings, executor);
    if (!read) return fail(read.error());
    informed = std::move(*read);
  } else {
    Result<VerificationReport> read = options.mirrored ? verify_either_way(*key, reading, settings, executor)
                                                       : verify_files(*key, reading, settings, executor);
    if (!read) return fail(read.error());
    verified = std::move(*read);
  }
  const VerificationReport& report = informed ? informed->report : *verified;
  const Result<ProofBasis> basis = proof_basis(*key, report.sources, options.proof);
  if (!basis) return fail(basis.error());
  const Standing standing = standing_of(report.verification, *basis);
  const std::optional<PayloadText> payload =
      key->corrects == 0 ? std::nullopt : std::optional(payload_text(*key, report.verification.read));
  if (!options.json.empty()) {
    nlohmann::ordered_json json = report_json<nlohmann::ordered_json>(report);
    json["proof"] = standing_json<nlohmann::ordered_json>(standing, *basis);
    if (payload) json["payload"] = payload->json;
    if (informed) json["informed"] = informed_json<nlohmann::ordered_json>(*informed);
    if (Result<Done> written = write_json(options.json, json); !written) return fail(written.error());
  }
  const ReportSources& from = report.sources;
  std::printf("key         %s, created %s according to the key file\n", from.key_id.c_str(), from.key_created.c_str());
  std::printf("commitment  %s\n", from.key_commitment.c_str());
  std::printf("decoder     %s, sha256 %s\n", from.decoder.c_str(), from.decoder_sha256.c_str());
  if (basis->claimed)
    std::printf("claim       sha256 %s%s%s\n", basis->claim_sha256.c_str(), basis->dated.empty() ? "" : ", stamped ",
                basis->dated.c_str());
  if (!from.model.empty()) std::printf("model       %s, sha256 %s\n", from.model.c_str(), from.model_sha256.c_str());
  if (!from.unmarked.empty()) {
    std::printf("less        %s, sha256 %s\n", from.unmarked.c_str(), from.unmarked_sha256.c_str());
  }
  if (!from.interference.empty()) {
    std::printf("less        %s, sha256 %s: what the unmarked scene says by itself\n", from.interference.c_str(),
                from.interference_sha256.c_str());
  }
  if (payload) std::fputs(payload->line.c_str(), stdout);
  if (report.mirrored) {
    std::printf("mirrored    %s; both ways were read, which is two tests\n",
                *report.mirrored ? "the images are read better so" : "the images are read as they are");
  }
  if (informed) std::fputs(informed_text(*informed).c_str(), stdout);
  std::fputs(report_text(report.verification, standing).c_str(), stdout);
  switch (report.verification.verdict) {
    case Verdict::detected:
      return standing.kind == StandingKind::not_a_proof ? inconclusive : success;
    case Verdict::not_detected:
      return not_detected;
    case Verdict::inconclusive:
      break;
  }
  return inconclusive;
}

}  // namespace

Command add_verify(Options& app) {
  auto options = std::make_shared<VerifyOptions>();
  app.reads("--key", options->key, InputKind::key, "the owner's key file (compmark keygen)")->required();
  add_reading_options(app, options->reading);
  app.number("--alpha", options->alpha, RealRange{0, 1, true},
             "false-positive rate you accept; choose it before you look")
      ->capture_default_str();
  app.number("--tests", options->tests, WholeRange{1, 1'000'000'000'000'000},
             "number of tests in all: keys times crops times models; the p-value is multiplied by "
             "it")
      ->capture_default_str();
  app.flag("--mirrored", options->mirrored,
           "the images may have been mirrored: read them both ways, which counts as two tests");
  app.also([options](FileUse& use) { add_record_read(use, options->key, options->reading.model); });
  app.reads("--claim", options->proof.claim, InputKind::claim,
            "the claim that was published before the images (compmark claim)");
  app.reads("--time-stamp", options->proof.time_stamp, InputKind::time_stamp,
            "the claim's time stamp, as an authority answered it (RFC 3161)");
  app.flag("--any-decoder", options->any_decoder,
           "use this decoder even if the record of this key (KEY.record) names another one");
  app.writes("--json", options->json, OutputKind::words, "write the report to this file");
  app.footer(
      "Exit codes: 0 detected; 1 not detected; 2 error; 3 inconclusive: tests times p is above --alpha but not above\n"
      "0.01, or no number of matches could reach --alpha with so few bits; or no proof, since decoder or key could "
      "have\n"
      "been made to fit and no claim names them. The p-value is the probability that a key drawn at random, without\n"
      "knowing the images and the decoder, matches at least as well.");
  return [options]() -> int { return with_decoder(*options, run); };
}

}  // namespace tool
