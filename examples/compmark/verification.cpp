// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "verification.hpp"

#include <cmath>
#include <compmark/app/run/mark_record.hpp>
#include <compmark/app/verify.hpp>
#include <utility>

#include "common.hpp"
#include "run_folder.hpp"
#include "run_options.hpp"

namespace tool {

using namespace compmark;

namespace {

/// What else could be read where nothing was detected; empty: nothing that was not tried. More tests weigh more, so
/// nothing is tried by itself.
std::string other_readings(const Verified& verified) {
  if (verified.verdict.verdict == Verdict::detected) return {};
  const VerificationReport& report = verified.report;
  if (!report.sources.model.empty()) {
    if (report.restored) return {};
    const std::string whole =
        "--unmarked MODEL --restored, if you have the unmarked model: it puts the model back together";
    return report.missing_share
               ? whole
               : "--pruned, if anchors may have been taken from the model, which is four tests; " + whole;
  }
  if (verified.informed) return {};
  const std::string unmarked = "--unmarked MODEL, if you have the unmarked model: it finds the camera of each picture";
  return report.mirrored ? unmarked : "--mirrored, if the pictures may be mirrored, which is two tests; " + unmarked;
}

}  // namespace

void add_verify_options(Options& app, const std::shared_ptr<VerifyOptions>& options) {
  app.reads("--key", options->key, InputKind::key, "the owner's key file (compmark keygen)")->required();
  add_reading_options(app, options->reading);
  app.number("--alpha", options->alpha, RealRange{0, 1, true},
             "false-positive rate you accept; choose it before you look")
      ->capture_default_str();
  app.number("--recipient-alpha", options->recipient_alpha, RealRange{0, 1, true},
             "of a key with recipients: rate you accept of naming anybody who had no part, all recipients together")
      ->capture_default_str();
  app.number("--tests", options->tests, WholeRange{1, 1'000'000'000'000'000},
             "number of tests in all: keys times crops times models; the p-value is multiplied by "
             "it")
      ->capture_default_str();
  app.flag("--mirrored", options->mirrored,
           "the images may have been mirrored: read them both ways, which counts as two tests");
  app.flag(
      "--pruned", options->pruned,
      "anchors may have been taken from the model: read it as it is and with what is left standing in for a share of "
      "0.2, 0.35 and 0.5, which counts as four tests");
  app.flag(
      "--restored", options->reading.restored,
      "put the features of --model back into the --unmarked model, anchor by anchor, and read that: what was taken "
      "from the model, doubled or rounded does not matter then");
  add_splat_up(app, options->reading.up, "any of these six");
  app.also([options](FileUse& use) { add_record_read(use, options->key, options->reading.model); });
  app.reads("--claim", options->proof.claim, InputKind::claim,
            "the claim that was published before others had the scene (compmark claim)");
  app.reads("--time-stamp", options->proof.time_stamp, InputKind::time_stamp,
            "the claim's time stamp, as an authority answered it (RFC 3161)");
  app.flag("--any-decoder", options->any_decoder,
           "use this decoder even if the record of this key (KEY.record) names another one");
}

Result<Verified> verify_by(const VerifyOptions& options, const ComparedObserver& compared) {
  VerifySettings settings;
  settings.false_positive_rate = options.alpha;
  settings.tries = options.tests;
  settings.recipient_rate = options.recipient_alpha;
  if (const Result<Done> checked = check_settings(settings); !checked) return checked.error();
  Result<OwnerKey> key = load_key(options.key);
  if (!key) return key.error();
  Verified verified{std::move(*key), {}, {}, {}, {}, {}, {}};
  // A claim that is not of this key is told before the reading.
  if (const Result<ProofBasis> claimed = proof_basis(verified.key, {}, options.proof); !claimed) return claimed.error();
  if (!options.any_decoder) {
    const Result<Done> recorded =
        check_recorded(options.key, verified.key, options.reading.decoder, options.reading.model, print_warning);
    if (!recorded) return recorded.error();
  }
  ThreadExecutor executor(options.reading.threads);
  tell_threads(executor, options.reading.threads);
  const ReadingSettings reading = reading_settings(options.reading);
  if (reading.restored && reading.model.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 "--restored",
                 "is for a model, and these are images",
                 "leave it out: --images with --unmarked is read informed"};
  }
  if (reading.restored && options.pruned) {
    return Error{
        ErrorKind::invalid, {}, "--pruned", "is given with --restored, which knows what is missing", "leave it out"};
  }
  if (options.pruned && (reading.model.empty() || options.mirrored)) {
    return Error{
        ErrorKind::invalid,
        {},
        "--pruned",
        options.mirrored ? "is given with --mirrored, which is for images" : "is for a model, and these are images",
        "leave it out, or give --model alone"};
  }
  if (reading.up && (!reading.model.empty() || reading.unmarked.empty())) {
    return Error{ErrorKind::invalid,
                 {},
                 "--up",
                 "is given, and no camera is looked for in an unmarked splat file",
                 "leave it out, or give --images and --unmarked"};
  }
  if (reading.model.empty() && !reading.unmarked.empty()) {
    if (!reading.interference.empty()) {
      return Error{ErrorKind::invalid, reading.interference.string(), "--interference",
                   "is given with --unmarked, which says more", "leave it out"};
    }
    ReadingSettings either_way = reading;
    either_way.mirrored = options.mirrored;  // which way is found without the key, and counts once
    Result<InformedReport> read = verify_informed(verified.key, either_way, settings, executor, {}, compared);
    if (!read) return read.error();
    verified.report = read->report;
    verified.verdict = read->together;
    verified.informed = std::move(*read);
  } else {
    Result<VerificationReport> read = options.pruned     ? verify_pruned(verified.key, reading, settings, executor)
                                      : options.mirrored ? verify_either_way(verified.key, reading, settings, executor)
                                                         : verify_files(verified.key, reading, settings, executor);
    if (!read) return read.error();
    verified.report = std::move(*read);
    verified.verdict = verified.report.verification;
  }
  Result<ProofBasis> basis = proof_basis(verified.key, verified.report.sources, options.proof);
  if (!basis) return basis.error();
  verified.basis = std::move(*basis);
  verified.standing = standing_of(verified.verdict, verified.basis);
  // Whose bits are shown beside what was read.
  if (const auto& trace = verified.verdict.recipients) verified.key.recipient = trace->nearest.number;
  if (verified.key.corrects != 0) verified.payload = payload_text(verified.key, verified.report.verification.read);
  return verified;
}

nlohmann::ordered_json verified_json(const Verified& verified) {
  nlohmann::ordered_json json = report_json<nlohmann::ordered_json>(verified.report);
  json["proof"] = standing_json<nlohmann::ordered_json>(verified.standing, verified.basis);
  if (verified.payload) json["payload"] = verified.payload->json;
  if (verified.informed) {
    json["verdict"] =
        std::string(verdict_name(verified.verdict.verdict));  // of both tests; the message's is in "informed"
    json["p_corrected"] = verified.verdict.p_corrected;
    json["informed"] = informed_json<nlohmann::ordered_json>(*verified.informed);
  }
  return json;
}

std::string verified_text(const Verified& verified) {
  const ReportSources& from = verified.report.sources;
  std::string text;
  const auto line = [&](const char* label, const std::string& rest) { text += label + rest + "\n"; };
  line("key         ", from.key_id + ", created " + from.key_created + " according to the key file");
  line("commitment  ", from.key_commitment);
  line("decoder     ", from.decoder + ", sha256 " + from.decoder_sha256);
  if (verified.basis.claimed) {
    line("claim       ", "sha256 " + verified.basis.claim_sha256 +
                             (verified.basis.dated.empty() ? "" : ", stamped " + verified.basis.dated));
  }
  if (!from.model.empty()) line("model       ", from.model + ", sha256 " + from.model_sha256);
  if (!from.unmarked.empty()) line("less        ", from.unmarked + ", sha256 " + from.unmarked_sha256);
  if (!from.interference.empty()) {
    line("less        ",
         from.interference + ", sha256 " + from.interference_sha256 + ": what the unmarked scene says by itself");
  }
  for (const ViewLogits& view : verified.report.views) {
    if (!view.part) continue;
    line("part        ", view.name + ": the picture on the page, " + std::to_string(view.part->width) + " x " +
                             std::to_string(view.part->height) + " pixels, " + std::to_string(view.part->left) +
                             " from the left and " + std::to_string(view.part->top) + " from the top");
  }
  if (verified.payload) text += verified.payload->line;
  if (verified.report.mirrored) {
    line("mirrored    ",
         std::string(*verified.report.mirrored ? "the images are read better so" : "the images are read as they are") +
             "; both ways were read, which is two tests");
  }
  if (verified.report.restored) {
    const RestoredFeatures& restored = *verified.report.restored;
    line("restored    ",
         std::to_string(restored.found) + " of " + std::to_string(restored.anchors) +
             " anchors of the unmarked model are in the model" +
             (restored.raised > 1 ? "; what they carry was raised " +
                                        compmark::detail::exact_text(std::round(100 * restored.raised) / 100) + " times"
                                  : std::string()));
  }
  if (verified.report.missing_share) {
    const double share = *verified.report.missing_share;
    line("pruned      ", (share == 0 ? "the model is read as it is"
                                     : "the model is read best as one that lacks " +
                                           compmark::detail::exact_text(100 * share) + " % of its anchors") +
                             std::string("; it was read in four ways, which is four tests"));
  }
  if (verified.informed) text += informed_text(*verified.informed);
  text += evidence_text(verified.report.verification);
  if (verified.informed) text += together_text(*verified.informed);
  if (const std::string more = other_readings(verified); !more.empty()) line("try         ", more);
  return text + verdict_text(verified.verdict, verified.standing);
}

int verified_code(const Verified& verified) {
  switch (verified.verdict.verdict) {
    case Verdict::detected:
      return verified.standing.kind == StandingKind::not_a_proof ? inconclusive : success;
    case Verdict::not_detected:
      return not_detected;
    case Verdict::inconclusive:
      break;
  }
  return inconclusive;
}

}  // namespace tool
