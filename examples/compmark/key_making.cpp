// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "key_making.hpp"

#include <array>
#include <compmark/watermark/proof/recipient_code.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <ctime>

#include "common.hpp"
#include "shell_word.hpp"

namespace tool {

using namespace compmark;

namespace {

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

}  // namespace

Result<std::string> make_dated_key(KeySettings settings) {
  settings.created = utc_now();
  const Result<MadeKey> made = make_key_file(settings, print_warning);
  if (!made) return made.error();
  const OwnerKey& key = made->key;
  std::string text =
      "key file    " + settings.out.string() + ": keep it secret, and keep a copy: it cannot be made again\n";
  if (!made->moved.empty()) text += "old key     moved to " + made->moved.string() + "\n";
  text += "key id      " + key.id() + "\nmessage     " + std::to_string(key.bits) + " bits\ncreated     " +
          key.created + "\ncommitment  " + key.commitment() + "\n";
  if (key.corrects != 0)
    text += "payload     " + key.payload + ", up to " + std::to_string(key.corrects) + " wrong bits corrected\n";
  if (key.recipients != 0) {
    text += "recipients  " + std::to_string(key.recipients) + ", 1 to " + std::to_string(key.recipients) + ": " +
            std::to_string(shared_bits(key.bits)) + " bits are in every copy, " +
            std::to_string(key.bits - shared_bits(key.bits)) +
            " name the recipient; mark each copy with its number, embed --recipient J\n";
  }
  text += "next: compmark claim --key " + shell_word(settings.out) +
          (settings.decoder.empty() ? "" : " --decoder " + shell_word(settings.decoder)) + " --out " +
          shell_word(settings.out.string() + ".claim") +
          "\n      Publish its SHA-256 where others date it, before anybody else has anything of the scene.\n";
  const double rate = VerifySettings{}.false_positive_rate, copies = static_cast<double>(key.recipients);
  if (!match_threshold(key.bits, key.recipients == 0 ? rate : rate / (2 * copies))) {
    print_warning(std::to_string(key.bits) + " bits can never be evidence at a false-positive rate of 1e-06");
  } else if (key.recipients != 0 && !match_threshold(shared_bits(key.bits), rate / 2)) {
    print_warning("of " + std::to_string(key.bits) + " bits, the " + std::to_string(shared_bits(key.bits)) +
                  " that all copies share are no evidence by themselves at a false-positive rate of 1e-06: copies that "
                  "are averaged will not be proven. Make the key with 48 or 64 bits");
  }
  return text;
}

}  // namespace tool
