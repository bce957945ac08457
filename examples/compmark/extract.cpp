// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark extract: prints the bits that a decoder reads, without a claim about their owner. Any image gives bits; only
// verify tests whether they are evidence.
#include <algorithm>
#include <cmath>
#include <compmark/app/run/mark_record.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.hpp"
#include "common.hpp"
#include "reading.hpp"
#include "run_folder.hpp"

namespace tool {
namespace {

using namespace compmark;

struct ExtractOptions {
  ReadingOptions reading;
  std::filesystem::path key;
  std::filesystem::path json;
  bool any_decoder = false;
};

struct Confidence {
  double mean = 0;
  double least = 0;
};
Confidence confidence_of(const std::vector<double>& logits) {
  Confidence confidence{0, std::abs(logits[0])};
  for (const double z : logits) {
    confidence.mean += std::abs(z) / static_cast<double>(logits.size());
    confidence.least = std::min(confidence.least, std::abs(z));
  }
  return confidence;
}

int run(const ExtractOptions& options) {
  std::optional<OwnerKey> key;
  if (!options.key.empty()) {
    Result<OwnerKey> read = load_key(options.key);
    if (!read) return fail(read.error());
    key = *read;
    if (!options.any_decoder) {
      const Result<Done> recorded =
          check_recorded(options.key, *key, options.reading.decoder, options.reading.model, print_warning);
      if (!recorded) return fail(recorded.error());
    }
  }
  const Result<Reading> reading = read_all(options.reading, key);
  if (!reading) return fail(reading.error());
  std::vector<double> fused(reading->bits);
  fuse_logits(reading->views, FusionRule::scaled, fused);
  const Message together = Message::from_logits<double>(fused);

  nlohmann::ordered_json json{
      {"schema", "compmark.extraction.1"}, {"bits", reading->bits}, {"hex", together.hex()}, {"fused_logits", fused}};
  const std::optional<PayloadText> payload =
      key && key->corrects != 0 ? std::optional(payload_text(*key, together)) : std::nullopt;
  if (payload) json["payload"] = payload->json;
  add_sources(json, reading->sources);
  json["views"] = nlohmann::ordered_json::array();
  for (const ViewLogits& view : reading->views) {
    const Message bits = Message::from_logits<double>(view.logits);
    json["views"].push_back({{"name", view.name},
                             {"sha256", view.sha256},
                             {"hex", bits.hex()},
                             {"agrees_with_fused", bits.matches(together)},
                             {"logits", view.logits}});
    if (view.part) {
      const PictureBox& part = *view.part;
      json["views"].back()["part"] = {
          {"left", part.left}, {"top", part.top}, {"width", part.width}, {"height", part.height}};
    }
  }
  if (!options.json.empty()) {
    if (Result<Done> written = write_json(options.json, json); !written) return fail(written.error());
  }
  std::printf("%zu bits from %zu view%s: %s\n", reading->bits, reading->views.size(),
              reading->views.size() == 1 ? "" : "s", together.hex().c_str());
  for (const ViewLogits& view : reading->views) {
    const Message bits = Message::from_logits<double>(view.logits);
    const Confidence confidence = confidence_of(view.logits);
    std::printf("  %-24s %s  |logit| mean %.3g, least %.2g; %zu of %zu bits as above\n", view.name.c_str(),
                bits.hex().c_str(), confidence.mean, confidence.least, bits.matches(together), bits.size());
  }
  if (payload) std::fputs(payload->line.c_str(), stdout);
  std::printf(
      "Every image gives bits, marked or not: compmark verify tests whether they are "
      "evidence\n");
  return success;
}

}  // namespace

Command add_extract(Options& app) {
  auto options = std::make_shared<ExtractOptions>();
  add_reading_options(app, options->reading);
  app.reads("--key", options->key, InputKind::key,
            "the owner's key; needed unless --decoder is a fitted or lattice decoder, and to read a payload");
  app.also([options](FileUse& use) { add_record_read(use, options->key, options->reading.model); });
  app.flag("--any-decoder", options->any_decoder,
           "use this decoder even if the record of this key (KEY.record) names another one");
  app.writes("--json", options->json, OutputKind::words, "write bits and logits to this file");
  return [options]() -> int { return with_decoder(*options, run); };
}

}  // namespace tool
