// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "mark_record.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <compmark/app/files.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/io/sha256.hpp>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>
#include <system_error>

#include "common.hpp"

namespace tool {
namespace {

using namespace compmark;
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* schema = "compmark.mark.1";
constexpr std::uintmax_t record_limit = std::uintmax_t{1} << 26;

Json file_json(const RecordedFile& file) { return {{"file", file.name}, {"sha256", file.sha256}}; }

Json to_json(const MarkRecord& record) {
  Json decoder = file_json(record.decoder);
  decoder["tensors_sha256"] = record.decoder_tensors;
  Json json{{"schema", schema},
            {"key", {{"id", record.key_id}, {"commitment", record.key_commitment}}},
            {"decoder", std::move(decoder)},
            {"models", Json::array()}};
  for (const RecordedFile& model : record.models) json["models"].push_back(file_json(model));
  json[std::string(checksum_key)] = compmark::detail::fields_checksum(json);
  return json;
}

std::string word(const Json& json, std::initializer_list<const char*> keys) {
  const Json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return {};
    at = &(*at)[key];
  }
  return at->is_string() ? at->get<std::string>() : std::string();
}

/// False if the JSON is no record, or one that was damaged: its checksum is another, or one of its fields has a name
/// that none has. Records of before have no checksum.
bool read(const Json& json, MarkRecord& record) {
  if (word(json, {"schema"}) != schema) return false;
  constexpr std::array<std::string_view, 4> fields{"schema", "key", "decoder", "models"};
  for (const auto& [name, value] : json.items()) {
    const bool known = std::find(fields.begin(), fields.end(), name) != fields.end();
    if (!known && (name != checksum_key || value != compmark::detail::fields_checksum(json))) return false;
  }
  record.key_id = word(json, {"key", "id"});
  record.key_commitment = word(json, {"key", "commitment"});
  record.decoder = {word(json, {"decoder", "file"}), word(json, {"decoder", "sha256"})};
  record.decoder_tensors = word(json, {"decoder", "tensors_sha256"});
  if (json.contains("models") && json["models"].is_array()) {
    for (const Json& model : json["models"]) record.models.push_back({word(model, {"file"}), word(model, {"sha256"})});
  }
  return !record.key_commitment.empty() && !record.decoder_tensors.empty();
}

/// One write at the end of the file: two runs at once leave two lines.
int append(const fs::path& path, std::string line) {
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

void warn_unkept(const fs::path& record, const fs::path& run, const std::string& why) {
  std::fprintf(stderr,
               "compmark: warning: %s cannot be written (%s); only %s records which decoder reads "
               "this mark\n",
               record.string().c_str(), why.c_str(), (run / "mark.json").string().c_str());
}

}  // namespace

std::string tensors_sha256(const SafetensorsFile& file) {
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

Result<KeptRecords> read_record(const fs::path& path) {
  KeptRecords kept;
  std::error_code status;
  if (path.empty() || !fs::is_regular_file(path, status)) return kept;
  const Result<std::vector<std::byte>> bytes = read_file(path, record_limit);
  if (!bytes) return bytes.error();
  std::istringstream lines(std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.empty()) continue;
    MarkRecord record;
    if (read(json_from<Json>(line), record)) {
      kept.records.push_back(std::move(record));
    } else {
      kept.unread.push_back(number);
    }
  }
  return kept;
}

std::optional<MarkRecord> read_mark(const fs::path& path) {
  MarkRecord record;
  const Result<Json> json = read_json<Json>(path);
  return json && read(*json, record) ? std::optional(std::move(record)) : std::nullopt;
}

fs::path key_record(const fs::path& key) {
  std::error_code status;
  if (key.empty() || !fs::is_regular_file(key, status)) return {};
  fs::path record = fs::canonical(key, status);
  if (status) return {};
  return record += ".record";
}
void add_record_read(FileUse& use, const fs::path& key, const fs::path& model) {
  use.read(key_record(key), "--key (its record)");
  if (!model.empty()) use.read(model.parent_path() / "mark.json", "--model (the record of its mark)");
}
void add_record_written(FileUse& use, const fs::path& key) { use.write(key_record(key), "--key (its record)"); }

void warn_of_record(const fs::path& key, const fs::path& run) {
  static bool told = false;
  const fs::path record = key_record(key);
  std::error_code status;
  const fs::path tried = fs::exists(record, status) ? record : record.parent_path();
  if (told || record.empty() || ::access(tried.c_str(), W_OK) == 0) return;
  told = true;
  warn_unkept(record, run, std::strerror(errno));
}

Result<Done> keep_record(const MarkRecord& record, const fs::path& key, const fs::path& run) {
  const Json json = to_json(record);
  if (Result<Done> written = write_json(run / "mark.json", json); !written) return written;
  const fs::path beside = key_record(key);
  if (beside.empty()) return Done{};
  const std::string line = json.dump();
  const Result<std::vector<std::byte>> before = read_file(beside, record_limit);
  std::string text;
  if (before) text.assign(reinterpret_cast<const char*>(before->data()), before->size());
  if (text.find(line + "\n") != std::string::npos) return Done{};  // the same run once more
  const bool cut = !text.empty() && text.back() != '\n';
  if (const int why = append(beside, (cut ? "\n" : "") + line + "\n"); why != 0)
    warn_unkept(beside, run, std::strerror(why));
  return Done{};
}

Result<Done> check_recorded(const fs::path& key_file, const OwnerKey& key, const fs::path& decoder,
                            const fs::path& model) {
  const fs::path beside = key_record(key_file);
  Result<KeptRecords> kept = read_record(beside);
  if (!kept) return kept.error();
  for (const int line : kept->unread) {
    std::fprintf(stderr, "compmark: warning: %s: line %d is not a valid record of a mark and is ignored\n",
                 beside.string().c_str(), line);
  }
  std::vector<MarkRecord>* const records = &kept->records;
  std::error_code status;
  if (const fs::path noted = model.parent_path() / "mark.json"; !model.empty() && fs::exists(noted, status)) {
    if (std::optional<MarkRecord> of_run = read_mark(noted)) {
      records->push_back(std::move(*of_run));
    } else {
      std::fprintf(stderr, "compmark: warning: %s is not a valid record of a mark and is ignored\n",
                   noted.string().c_str());
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

}  // namespace tool
