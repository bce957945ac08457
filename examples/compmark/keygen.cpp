// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark keygen: a new owner's key (compmark/app/run/owner_keys.hpp).
#include <compmark/app/run/owner_keys.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "commands.hpp"
#include "common.hpp"
#include "key_making.hpp"

namespace tool {
namespace {

using namespace compmark;

struct KeygenOptions : KeySettings {
  bool quick = false;
};

int keygen(const KeySettings& settings) {
  const Result<std::string> told = make_dated_key(settings);
  if (!told) return fail(told.error());
  std::fputs(told->c_str(), stdout);
  return success;
}

}  // namespace

Command add_keygen(Options& app) {
  auto options = std::make_shared<KeygenOptions>();
  app.writes("--out", options->out, OutputKind::key, "key file to write, readable by you only")->required();
  app.number("--bits", options->bits, WholeRange{1, OwnerKey::bits_limit},
             "length of the message, the same as that of the decoder (1 to 128)")
      ->capture_default_str();
  app.word("--note", options->note, "a note to recognise the key; it is not part of the commitment");
  app.word("--payload", options->payload,
           "identifier in the message, hexadecimal digits; it takes bits of the message, but the"
           " evidence stays the same");
  app.number("--corrects", options->corrects, WholeRange{1, 128}, "wrong bits that the code of the payload corrects")
      ->capture_default_str();
  app.number("--recipients", options->recipients, WholeRange{2, OwnerKey::recipients_limit},
             "copies that have messages of their own: half of the bits are the same in all and prove the owner, the"
             " others name whose copy leaked; mark each with embed --recipient J (at most 16,777 with 48 bits)");
  app.reads("--from", options->from, InputKind::key,
            "use the secret of this key, which has a payload of the same --bits and --corrects: one key then reads the "
            "payloads of all, but see docs/verification.md; or, with --recipients, a key of more recipients");
  app.reads("--decoder", options->decoder, InputKind::decoder,
            "bind the key to this decoder: its marks are read with this file alone, and a decoder of your own is then a"
            " proof as those are that come with the program");
  app.flag("--quick", options->quick,
           "derive without scrypt, at once: for experiments, since such keys can be tried by the million");
  app.flag("--force", options->force, "move an existing key to FILE.<id>.old");
  return [options]() -> int {
    if (options->quick) options->hardness = 0;
    return keygen(*options);
  };
}

}  // namespace tool
