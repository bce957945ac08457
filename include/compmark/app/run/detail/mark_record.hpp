// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/mark_record.hpp.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/app/files.hpp"
#include "compmark/app/run/mark_record.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/read_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/io/sha256.hpp"

namespace compmark {
namespace detail {

inline constexpr const char* mark_schema = "compmark.mark.1";
inline constexpr std::uintmax_t mark_record_limit = std::uintmax_t{1} << 26;

inline nlohmann::ordered_json recorded_file_json(const RecordedFile& file) {
  return {{"file", file.name}, {"sha256", file.sha256}};
}

inline nlohmann::ordered_json mark_record_json(const MarkRecord& record) {
  nlohmann::ordered_json decoder = recorded_file_json(record.decoder);
  decoder["tensors_sha256"] = record.decoder_tensors;
  nlohmann::ordered_json json{{"schema", mark_schema},
                              {"key", {{"id", record.key_id}, {"commitment", record.key_commitment}}},
                              {"decoder", std::move(decoder)},
                              {"models", nlohmann::ordered_json::array()}};
  for (const RecordedFile& model : record.models) json["models"].push_back(recorded_file_json(model));
  if (record.recipient != 0) json["recipient"] = record.recipient;
  json[std::string(checksum_key)] = fields_checksum(json);
  return json;
}

inline std::string word_at(const nlohmann::ordered_json& json, std::initializer_list<const char*> keys) {
  const nlohmann::ordered_json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return {};
    at = &(*at)[key];
  }
  return at->is_string() ? at->get<std::string>() : std::string();
}

/// False if the JSON is no record, or one that was damaged: its checksum is another, or one of its fields has a name
/// that none has. Records of before have no checksum.
inline bool read_mark_record(const nlohmann::ordered_json& json, MarkRecord& record) {
  if (word_at(json, {"schema"}) != mark_schema) return false;
  constexpr std::array<std::string_view, 5> fields{"schema", "key", "decoder", "models", "recipient"};
  for (const auto& [name, value] : json.items()) {
    const bool known = std::find(fields.begin(), fields.end(), name) != fields.end();
    if (!known && (name != checksum_key || value != fields_checksum(json))) return false;
  }
  record.key_id = word_at(json, {"key", "id"});
  record.key_commitment = word_at(json, {"key", "commitment"});
  record.decoder = {word_at(json, {"decoder", "file"}), word_at(json, {"decoder", "sha256"})};
  record.decoder_tensors = word_at(json, {"decoder", "tensors_sha256"});
  if (json.contains("models") && json["models"].is_array()) {
    for (const nlohmann::ordered_json& model : json["models"])
      record.models.push_back({word_at(model, {"file"}), word_at(model, {"sha256"})});
  }
  if (json.contains("recipient")) {
    if (!json["recipient"].is_number_unsigned()) return false;
    record.recipient = json["recipient"].get<std::size_t>();
  }
  return !record.key_commitment.empty() && !record.decoder_tensors.empty();
}

/// One write at the end of the file: two runs at once leave two lines.
inline int append_line(const std::filesystem::path& path, std::string line) {
  const int file = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0600);
  if (file < 0) return errno;
  int why = 0;
  errno = 0;
  const ssize_t written = ::write(file, line.data(), line.size());
  if (written != static_cast<ssize_t>(line.size())) {
    why = errno != 0 ? errno : ENOSPC;  // of a full disk the first bytes may be there
    struct ::stat now {};
    if (written > 0 && ::fstat(file, &now) == 0 && ::ftruncate(file, now.st_size - written) != 0) errno = 0;
  }
  if (why == 0 && ::fsync(file) != 0 && errno != EINVAL) why = errno;
  if (::close(file) != 0 && why == 0) why = errno;
  return why;
}

inline std::string unkept_record(const std::filesystem::path& record, const std::filesystem::path& run,
                                 const std::string& why) {
  return record.string() + " cannot be written (" + why + "); only " + (run / "mark.json").string() +
         " records which decoder reads this mark";
}

}  // namespace detail

COMPMARK_APP_INLINE std::string tensors_sha256(const SafetensorsFile& file) {
  Sha256 hash;
  const auto number = [&](std::uint64_t value) {
    std::array<std::byte, 8> bytes{};
    for (std::size_t i = 0; i < 8; ++i) bytes[i] = static_cast<std::byte>(value >> (8 * i) & 0xFFu);
    hash.update(bytes);
  };
  const auto text = [&](const std::string& value) {
    number(value.size());
    hash.update(std::as_bytes(std::span<const char>(value.data(), value.size())));
  };
  for (const auto& [name, tensor] : file.tensors) {
    text(name);
    text(tensor.dtype);
    number(tensor.shape.size());
    for (const std::int64_t extent : tensor.shape) number(static_cast<std::uint64_t>(extent));
    number(tensor.data.size());
    hash.update(tensor.data);
  }
  return hash.hex();
}

COMPMARK_APP_INLINE Result<KeptRecords> read_record(const std::filesystem::path& path) {
  KeptRecords kept;
  std::error_code status;
  if (path.empty() || !std::filesystem::is_regular_file(path, status)) return kept;
  const Result<std::vector<std::byte>> bytes = read_file(path, detail::mark_record_limit);
  if (!bytes) return bytes.error();
  std::istringstream lines(std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.empty()) continue;
    MarkRecord record;
    if (detail::read_mark_record(json_from<nlohmann::ordered_json>(line), record)) {
      kept.records.push_back(std::move(record));
    } else {
      kept.unread.push_back(number);
    }
  }
  return kept;
}

COMPMARK_APP_INLINE std::optional<MarkRecord> read_mark(const std::filesystem::path& path) {
  MarkRecord record;
  const Result<nlohmann::ordered_json> json = read_json<nlohmann::ordered_json>(path);
  return json && detail::read_mark_record(*json, record) ? std::optional(std::move(record)) : std::nullopt;
}

COMPMARK_APP_INLINE std::filesystem::path key_record(const std::filesystem::path& key) {
  std::error_code status;
  if (key.empty() || !std::filesystem::is_regular_file(key, status)) return {};
  std::filesystem::path record = std::filesystem::canonical(key, status);
  if (status) return {};
  return record += ".record";
}
COMPMARK_APP_INLINE void warn_of_record(const std::filesystem::path& key, const std::filesystem::path& run,
                                        const SentenceSink& warn) {
  const std::filesystem::path record = key_record(key);
  std::error_code status;
  const std::filesystem::path tried = std::filesystem::exists(record, status) ? record : record.parent_path();
  if (record.empty() || ::access(tried.c_str(), W_OK) == 0) return;
  const int why = errno;
  if (warn) warn(detail::unkept_record(record, run, std::strerror(why)));
}

COMPMARK_APP_INLINE Result<Done> keep_record(const MarkRecord& record, const std::filesystem::path& key,
                                             const std::filesystem::path& run, const SentenceSink& warn) {
  const nlohmann::ordered_json json = detail::mark_record_json(record);
  if (Result<Done> written = write_json(run / "mark.json", json); !written) return written;
  const std::filesystem::path beside = key_record(key);
  if (beside.empty()) return Done{};
  const std::string line = json.dump();
  const Result<std::vector<std::byte>> before = read_file(beside, detail::mark_record_limit);
  std::string text;
  if (before) text.assign(reinterpret_cast<const char*>(before->data()), before->size());
  if (text.find(line + "\n") != std::string::npos) return Done{};  // the same run once more
  const bool cut = !text.empty() && text.back() != '\n';
  if (const int why = detail::append_line(beside, (cut ? "\n" : "") + line + "\n"); why != 0) {
    if (warn) warn(detail::unkept_record(beside, run, std::strerror(why)));
  }
  return Done{};
}

COMPMARK_APP_INLINE Result<Done> check_recorded(const std::filesystem::path& key_file, const OwnerKey& key,
                                                const std::filesystem::path& decoder,
                                                const std::filesystem::path& model, const SentenceSink& warn) {
  const std::filesystem::path beside = key_record(key_file);
  Result<KeptRecords> kept = read_record(beside);
  if (!kept) return kept.error();
  for (const int line : kept->unread) {
    if (warn)
      warn(beside.string() + ": line " + std::to_string(line) + " is not a valid record of a mark and is ignored");
  }
  std::vector<MarkRecord>* const records = &kept->records;
  std::error_code status;
  if (const std::filesystem::path noted = model.parent_path() / "mark.json";
      !model.empty() && std::filesystem::exists(noted, status)) {
    if (std::optional<MarkRecord> of_run = read_mark(noted)) {
      records->push_back(std::move(*of_run));
    } else if (warn) {
      warn(noted.string() + " is not a valid record of a mark and is ignored");
    }
  }
  std::erase_if(*records, [&](const MarkRecord& record) { return record.key_commitment != key.commitment(); });
  if (records->empty()) return Done{};
  if (!model.empty()) {  // what is known of this very model counts alone
    const Result<std::string> digest = file_sha256(model);
    if (!digest) return digest.error();
    const auto of_model = [&](const MarkRecord& record) {
      return std::any_of(record.models.begin(), record.models.end(),
                         [&](const RecordedFile& file) { return file.sha256 == *digest; });
    };
    if (std::any_of(records->begin(), records->end(), of_model))
      std::erase_if(*records, [&](const MarkRecord& record) { return !of_model(record); });
  }
  const Result<SafetensorsFile> file = read_safetensors(decoder);
  if (!file) return file.error();
  const std::string tensors = tensors_sha256(*file);
  for (const MarkRecord& record : *records) {
    if (record.decoder_tensors == tensors) return Done{};
  }
  const MarkRecord& last = records->back();
  return Error{ErrorKind::invalid, decoder.string(), "--decoder",
               "is not the decoder of this key's mark: its tensors have SHA-256 " + tensors + ", those on record " +
                   last.decoder_tensors + " (" + last.decoder.name + ", file " + last.decoder.sha256 + ")",
               "give the decoder on record, or a copy of it; to use this one anyway, give "
               "--any-decoder"};
}

}  // namespace compmark
