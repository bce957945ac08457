// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark verify: is the message of this key in a model or in images, and how likely would that be by chance.
#include <compmark/io/json_file.hpp>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "common.hpp"
#include "verification.hpp"

namespace tool {
namespace {

using namespace compmark;

struct Verify : VerifyOptions {
  std::filesystem::path json;
};

int run(const Verify& options) {
  const Result<Verified> verified = verify_by(options);
  if (!verified) return fail(verified.error());
  if (!options.json.empty()) {
    if (Result<Done> written = write_json(options.json, verified_json(*verified)); !written)
      return fail(written.error());
  }
  std::fputs(verified_text(*verified).c_str(), stdout);
  return verified_code(*verified);
}

}  // namespace

Command add_verify(Options& app) {
  auto options = std::make_shared<Verify>();
  add_verify_options(app, options);
  app.writes("--json", options->json, OutputKind::words, "write the report to this file");
  app.footer(
      "Exit codes: 0 detected; 1 not detected; 2 error; 3 inconclusive, or no proof. Inconclusive: tests times p is "
      "above --alpha but not above\n"
      "0.01, or no number of matches could reach --alpha with so few bits; or no proof, since decoder or key could "
      "have\n"
      "been made to fit and no claim names them. The p-value is the probability that a key drawn at random, without\n"
      "knowing the images and the decoder, matches at least as well.");
  return [options]() -> int { return with_decoder(*options, run); };
}

}  // namespace tool
