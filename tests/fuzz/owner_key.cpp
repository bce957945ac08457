// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as a claim and as a time stamp, as an owner's key, as its fields with commitment, id and checksum made right, and as the record beside a
// key: an answer, never a crash. A key that is accepted is written and read again the same; and one byte changed in
// what was written never gives another key.
#include <compmark/app/run/mark_record.hpp>
#include <compmark/io/owner_claim.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/time_stamp.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/message.hpp>

#include "any_tensors.hpp"

namespace {

using namespace compmark;

struct Place {
  std::filesystem::path folder = testing::fuzz_folder();
  std::filesystem::path key = folder / "a.key", copy = folder / "b.key", owner = folder / "owner.key",
                        decoder = folder / "decoder.safetensors", model = folder / "model.safetensors";
  OwnerKey known;

  Place() {
    Digest256 secret{};
    secret[3] = std::byte{7};
    known = *make_key(secret, "2026-01-31T23:59:59Z", 48);
    const std::vector<float> numbers{1, 2, 3};
    SafetensorsWriter writer;
    writer.metadata = {{"format", "compmark decoder"}};
    writer.add_values("a", {3}, std::span<const float>(numbers));
    if (!write_key(owner, known) || !writer.write(decoder) || !writer.write(model)) std::abort();
  }
};

bool same_key(const OwnerKey& a, const OwnerKey& b) {
  return a.secret == b.secret && a.created == b.created && a.bits == b.bits && a.note == b.note &&
         a.payload == b.payload && a.corrects == b.corrects && a.hardness == b.hardness && a.root() == b.root() &&
         a.recipients == b.recipients;
}

void look(const Place& place, std::span<const std::byte> bytes, std::size_t damage) {
  testing::put_bytes(place.key, bytes);
  const Result<OwnerKey> key = read_key(place.key);
  if (!key) {
    testing::require_words(key.error());
    return;
  }
  if (check_payload(*key)) {
    if (message_of(*key).size() != key->bits) std::abort();
  }
  std::filesystem::remove(place.copy);
  if (!write_key(place.copy, *key)) std::abort();
  const Result<OwnerKey> again = read_key(place.copy);
  if (!again || !same_key(*again, *key)) std::abort();
  std::vector<std::byte> bad = *read_file(place.copy);
  bad[damage % bad.size()] ^= static_cast<std::byte>(1 + damage % 255);
  testing::put_bytes(place.copy, bad);
  const Result<OwnerKey> other = read_key(place.copy);
  if (other.ok() && !same_key(*other, *key)) std::abort();
}

/// The fields with what belongs to them, as far as they are a key's.
std::vector<std::byte> repaired(std::span<const std::byte> bytes) {
  auto json = json_from({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (!json.is_object()) return {};
  json["format"] = OwnerKey::format;
  const auto word = [&](const char* name) {
    return json.contains(name) && json[name].is_string() ? json[name].template get<std::string>() : std::string();
  };
  OwnerKey key;
  if (json.contains("hardness")) json["hardness"] = key.hardness = OwnerKey::least_hardness;  // the quickest
  if (json.contains("recipients") && json["recipients"].is_number_unsigned())
    key.recipients = json["recipients"].template get<std::size_t>();
  key.decoder = word("decoder");
  key.before_version_5 = json.contains("version") && json["version"].is_number_unsigned() && json["version"] < 5;
  json["version"] = key.version();
  if (from_hex(word("secret"), key.secret)) {
    key.created = word("created");
    if (json.contains("bits") && json["bits"].is_number_unsigned()) key.bits = json["bits"].template get<std::size_t>();
    if (json.contains("payload") && json["payload"].is_object()) {
      const auto& payload = json["payload"];
      if (payload.contains("hex") && payload["hex"].is_string())
        key.payload = payload["hex"].template get<std::string>();
      if (payload.contains("corrects") && payload["corrects"].is_number_unsigned())
        key.corrects = payload["corrects"].template get<std::size_t>();
    }
    json["commitment"] = key.commitment();
    json["id"] = key.id();
  }
  json[std::string(checksum_key)] = detail::fields_checksum(json);
  const std::string text = json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
  const auto out = std::as_bytes(std::span<const char>(text.data(), text.size()));
  return {out.begin(), out.end()};
}

/// The line that a mark with this decoder leaves, with the input's bytes in place of some of it; then lines of the
/// input alone.
void look_at_record(const Place& place, std::span<const std::byte> bytes) {
  std::string text =
      R"({"schema":"compmark.mark.1","key":{"id":"","commitment":")" + place.known.commitment() +
      R"("},"decoder":{"file":"a","sha256":"b","tensors_sha256":"c"},"models":[{"file":"m","sha256":"d"}]})";
  const std::size_t at = bytes.empty() ? 0 : std::to_integer<std::size_t>(bytes[0]) % text.size();
  const std::string given(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  text = given + "\n" + text + "\n" + text.substr(0, at) + given + text.substr(at) + "\n";
  const auto record = std::as_bytes(std::span<const char>(text.data(), text.size()));
  testing::put_bytes(place.owner.string() + ".record", record);
  testing::put_bytes(place.folder / "mark.json", bytes);
  // There is a mark on record with another decoder, and no line can hide it: only one that names this decoder lifts the
  // refusal.
  const Result<Done> checked = check_recorded(place.owner, place.known, place.decoder, place.model, {});
  if (!checked) testing::require_words(checked.error());
  static const std::string own = tensors_sha256(*read_safetensors(place.decoder));
  if (checked.ok() && text.find(own) == std::string::npos && given.find("\\u") == std::string::npos) std::abort();
}

/// A claim that is read is the text that was given; a time stamp is an answer or an error.
void look_at_claim(const Place& place, std::span<const std::byte> bytes) {
  testing::put_bytes(place.copy, bytes);
  const Result<OwnerClaim> claim = read_claim(place.copy);
  if (claim) {
    const std::string text = claim->text();
    if (text != std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size())) std::abort();
  } else {
    testing::require_words(claim.error());
  }
  const Result<TimeStamp> stamp = read_time_stamp(bytes, "a.tsr");
  if (!stamp) testing::require_words(stamp.error());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Place place;
  testing::FuzzInput input(data, size);
  const std::size_t damage = input.word();
  const std::span<const std::byte> bytes = input.rest();
  look(place, bytes, damage);
  if (const std::vector<std::byte> good = repaired(bytes); !good.empty()) look(place, good, damage);
  look_at_record(place, bytes);
  look_at_claim(place, bytes);
  return 0;
}
