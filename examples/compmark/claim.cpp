// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark claim: the line that an owner publishes before anybody else has the scene, so that what verify says later is a proof.
#include <compmark/app/proof.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <system_error>

#include "commands.hpp"
#include "common.hpp"
#include "decoder_choice.hpp"
#include "reading.hpp"
#include "shell_word.hpp"

namespace tool {
namespace {

using namespace compmark;

struct ClaimOptions : ClaimSettings {
  std::filesystem::path key, out;
};

int claim(ClaimOptions& options) {
  // Where a decoder was named, the commands that come next need it too.
  const std::string decoder = options.decoder.empty() ? "" : " --decoder " + shell_word(options.decoder);
  if (const Result<Done> chosen = choose_decoder(options.decoder, {}); !chosen) return fail(chosen.error());
  const Result<OwnerKey> key = load_key(options.key);
  if (!key) return fail(key.error());
  const Result<OwnerClaim> made = make_claim(*key, options);
  if (!made) return fail(made.error());
  // A claim may be stamped or published: the same one is written again, another one never over it.
  if (std::error_code none; std::filesystem::exists(options.out, none)) {
    if (const Result<OwnerClaim> before = read_claim(options.out); !before || before->text() != made->text()) {
      return fail(Error{ErrorKind::invalid, options.out.string(), "--out", "is there already, and says something else",
                        "name another file, or move it away"});
    }
  }
  if (const Result<Done> written = write_claim(options.out, *made); !written) return fail(written.error());
  const std::string file = shell_word(options.out), key_file = shell_word(options.key);
  // Who names the unmarked model has one, and marks that.
  std::string marks = "train --data SCENE --out RUN", subtracts;
  if (!options.unmarked.empty()) {
    marks = "embed --model " + shell_word(options.unmarked) + (is_splat_file(options.unmarked) ? "" : " --data SCENE") +
            " --out RUN";
    subtracts = " --unmarked " + shell_word(options.unmarked);
  }
  if (subtracts.empty() && !options.interference.empty())
    subtracts = " --interference " + shell_word(options.interference);
  std::printf("%s%s: sha256 %s\n", made->text().c_str(), options.out.c_str(), to_hex(made->digest()).c_str());
  std::printf(
      "Publish this SHA-256, or the file, where others date it, before anybody else has anything of the scene. A "
      "time-stamping authority "
      "answers\n  openssl ts -query -data %s -sha256 -cert -out request.tsq\n"
      "and its answer, if there is one, is --time-stamp ANSWER when you verify.\n"
      "next: %scompmark %s --key %s%s\n"
      "then: compmark verify --images PICTURES --key %s%s%s --claim %s\n",
      file.c_str(), options.unmarked.empty() ? "" : "unless it is marked already, ", marks.c_str(), key_file.c_str(),
      decoder.c_str(), key_file.c_str(), decoder.c_str(), subtracts.c_str(), file.c_str());
  return success;
}

}  // namespace

Command add_claim(Options& app) {
  auto options = std::make_shared<ClaimOptions>();
  app.reads("--key", options->key, InputKind::key, "the owner's key file (compmark keygen)")->required();
  app.writes("--out", options->out, OutputKind::words, "claim to write: one line, which tells no secret")->required();
  app.reads("--decoder", options->decoder, InputKind::decoder,
            "the decoder that reads the marks of this key (default: the one that comes with the program)");
  app.reads("--unmarked", options->unmarked, InputKind::model, "the unmarked model, if verify may subtract it");
  app.reads("--interference", options->interference, InputKind::interference,
            "what the unmarked model says by itself, if verify may subtract it (compmark interference)");
  return [options]() -> int { return claim(*options); };
}

}  // namespace tool
