// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark keygen: a new owner's key, 256 random bits of the operating system. A key that exists is never lost: --force
// moves it aside.
#include <compmark/io/os_random.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>
#include <system_error>

#include "commands.hpp"
#include "common.hpp"
#include "reading.hpp"
#include "run_folder.hpp"

namespace tool {
namespace {

using namespace compmark;
namespace fs = std::filesystem;

struct KeygenOptions {
  fs::path out;
  std::size_t bits = 48;
  std::string note;
  std::string payload;
  std::size_t corrects = 4;
  fs::path from;
  bool force = false;
};

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

/// Where an existing key goes: <file>.<id>.old. Whatever else is there is left alone.
Result<fs::path> move_aside(const fs::path& path) {
  const Result<OwnerKey> old = read_key(path);
  if (!old) {
    return Error{ErrorKind::unwritable, path.string(), {}, "exists and is not a whole key file", "choose another name"};
  }
  fs::path aside = path;
  aside += "." + old->id() + ".old";
  std::error_code status;
  if (!fs::exists(aside, status)) fs::rename(path, aside, status);
  if (status || fs::exists(path)) {
    return Error{ErrorKind::unwritable,
                 aside.string(),
                 {},
                 "the old key cannot be moved there",
                 "choose another name for the new one"};
  }
  return aside;
}

int run(const KeygenOptions& options) {
  Digest256 secret{};
  if (!options.from.empty()) {
    const Result<OwnerKey> other = load_key(options.from);
    if (!other) return fail(other.error());
    secret = other->secret;
  } else if (Result<Done> drawn = os_random(secret); !drawn) {
    return fail(drawn.error());
  }
  Result<OwnerKey> key = make_key(secret, utc_now(), options.bits, options.note);
  if (!key) return fail(key.error());
  if (!options.payload.empty()) {
    key->payload = options.payload;
    key->corrects = options.corrects;
    if (const Result<Done> fits = check_payload(*key); !fits) return fail(fits.error());
  } else if (!options.from.empty()) {
    return fail({ErrorKind::invalid,
                 {},
                 "--from",
                 "would make the same key again",
                 "give the new key a payload of its own with --payload"});
  }
  // Of two processes that make the same name at once, the second would replace the first's key, which somebody was told
  // of and nobody has.
  const Result<std::shared_ptr<const void>> alone = hold_file(options.out);
  if (!alone) return fail(alone.error());
  fs::path aside;
  std::error_code status;
  if (options.force && fs::exists(options.out, status)) {
    const Result<fs::path> moved = move_aside(options.out);
    if (!moved) return fail(moved.error());
    aside = *moved;
  }
  if (Result<Done> written = write_key(options.out, *key); !written) {
    if (!aside.empty()) fs::rename(aside, options.out, status);
    Error error = written.error();
    if (!options.force && fs::exists(options.out, status)) error.remedy += ", or move it aside with --force";
    return fail(error);
  }
  std::printf("key file    %s: keep it secret, and keep a copy: it cannot be made again\n",
              options.out.string().c_str());
  if (!aside.empty()) std::printf("old key     moved to %s\n", aside.string().c_str());
  std::printf("key id      %s\nmessage     %zu bits\ncreated     %s\ncommitment  %s\n", key->id().c_str(), key->bits,
              key->created.c_str(), key->commitment().c_str());
  if (key->corrects != 0)
    std::printf("payload     %s, up to %zu wrong bits corrected\n", key->payload.c_str(), key->corrects);
  std::printf(
      "Publish the commitment before you publish a marked model. If the decoder is your "
      "own, publish its SHA-256 too. Do so\nwhere others date it\n");
  if (!match_threshold(key->bits, VerifySettings{}.false_positive_rate)) {
    std::fprintf(stderr, "compmark: warning: %zu bits can never be evidence at a false-positive rate of 1e-06\n",
                 key->bits);
  }
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
  app.reads("--from", options->from, InputKind::key,
            "use the secret of this key: one key then reads the payloads of all, but see "
            "docs/verification.md");
  app.flag("--force", options->force, "move an existing key to FILE.<id>.old");
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
