// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark calibrate: tests random keys against images that do not carry their messages. It measures whether the
// p-values of compmark verify are right for a decoder, and the bias and correlation of its bits. Keys are derived as
// those of keygen are, from secrets that follow from --seed.
#include <compmark/io/json_file.hpp>
#include <compmark/watermark/proof/calibrate.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.hpp"
#include "common.hpp"
#include "reading.hpp"

namespace tool {
namespace {

using namespace compmark;

struct CalibrateOptions {
  ReadingOptions reading;
  std::filesystem::path key;
  std::filesystem::path json;
  std::size_t keys = 10000;
  std::uint64_t seed = 1;
};

int run(const CalibrateOptions& options) {
  std::optional<OwnerKey> key;
  if (!options.key.empty()) {
    Result<OwnerKey> read = load_key(options.key);
    if (!read) return fail(read.error());
    key = *read;
  }
  const Result<Reading> reading = read_all(options.reading, key);
  if (!reading) return fail(reading.error());
  CalibrationSettings settings;
  settings.keys = options.keys;
  const std::string seed = "compmark calibrate " + std::to_string(options.seed) + " ";
  const Result<NullCalibration> result = calibrate_null(reading->views, settings, [&](std::size_t i) {
    const std::string number = std::to_string(i);
    OwnerKey drawn;
    drawn.secret = sha256_digest({bytes_of(seed), bytes_of(number)});
    drawn.bits = reading->bits;
    return message_of(drawn);
  });
  if (!result) return fail(result.error());
  if (!options.json.empty()) {
    nlohmann::ordered_json json = calibration_json<nlohmann::ordered_json>(*result);
    json["seed"] = options.seed;
    add_sources(json, reading->sources);
    json["views"] = nlohmann::ordered_json::array();
    for (const ViewLogits& view : reading->views)
      json["views"].push_back({{"name", view.name}, {"sha256", view.sha256}, {"logits", view.logits}});
    if (Result<Done> written = write_json(options.json, json); !written) return fail(written.error());
  }
  std::fputs(calibration_text(*result).c_str(), stdout);
  return result->holds() ? success : inconclusive;
}

}  // namespace

Command add_calibrate(Options& app) {
  auto options = std::make_shared<CalibrateOptions>();
  add_reading_options(app, options->reading);
  app.reads("--key", options->key, InputKind::key,
            "the owner's key; needed unless --decoder is a fitted or lattice decoder");
  app.number("--keys", options->keys, WholeRange{1, 10'000'000}, "random keys to try")->capture_default_str();
  app.number("--seed", options->seed, any_seed, "seed of the random keys")->capture_default_str();
  app.writes("--json", options->json, OutputKind::words, "write figures and logits to this file");
  app.footer(
      "Exit codes: 0 every measured rate agrees with the p-value; 2 error; 3 one lies outside its 99 % interval,\n"
      "which about one seed in thirty does by chance: repeat with another --seed and more --keys.");
  return [options]() -> int { return with_decoder(*options, run); };
}

}  // namespace tool
