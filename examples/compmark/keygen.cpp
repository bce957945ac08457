// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark keygen: a new owner's key (compmark/app/run/owner_keys.hpp).
#include <array>
#include <compmark/app/run/owner_keys.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>

#include "commands.hpp"
#include "common.hpp"

namespace tool {
namespace {

using namespace compmark;

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

int keygen(KeySettings settings) {
  settings.created = utc_now();
  const Result<MadeKey> made = make_key_file(settings, print_warning);
  if (!made) return fail(made.error());
  const OwnerKey& key = made->key;
  std::printf("key file    %s: keep it secret, and keep a copy: it cannot be made again\n",
              settings.out.string().c_str());
  if (!made->moved.empty()) std::printf("old key     moved to %s\n", made->moved.string().c_str());
  std::printf("key id      %s\nmessage     %zu bits\ncreated     %s\ncommitment  %s\n", key.id().c_str(), key.bits,
              key.created.c_str(), key.commitment().c_str());
  if (key.corrects != 0)
    std::printf("payload     %s, up to %zu wrong bits corrected\n", key.payload.c_str(), key.corrects);
  std::printf(
      "Publish the commitment before you publish a marked model. If the decoder is your "
      "own, publish its SHA-256 too. Do so\nwhere others date it\n");
  if (!match_threshold(key.bits, VerifySettings{}.false_positive_rate)) {
    std::fprintf(stderr, "compmark: warning: %zu bits can never be evidence at a false-positive rate of 1e-06\n",
                 key.bits);
  }
  return success;
}

}  // namespace

Command add_keygen(Options& app) {
  auto options = std::make_shared<KeySettings>();
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
  app.reads("--from", options->from, InputKind::key,
            "use the secret of this key: one key then reads the payloads of all, but see "
            "docs/verification.md");
  app.flag("--force", options->force, "move an existing key to FILE.<id>.old");
  return [options]() -> int { return keygen(*options); };
}

}  // namespace tool
