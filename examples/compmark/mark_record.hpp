// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Records of the decoders that read the marks of a key. Every hidden mark is recorded in mark.json of its run, and as a
// line of <key>.record beside the key; that file is only appended to, and the key file is never changed. A later
// reading with another decoder gives an error, because it would not find a message that is there.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors_reader.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "file_use.hpp"

namespace tool {

struct RecordedFile {
  std::string name, sha256;
};
struct MarkRecord {
  std::string key_id, key_commitment;
  RecordedFile decoder;
  std::string decoder_tensors;       ///< tensors_sha256
  std::vector<RecordedFile> models;  ///< that hold the mark
};

/// The marks of a record, and the lines (from 1) that are none or were damaged. Each carries a checksum of its fields.
struct KeptRecords {
  std::vector<MarkRecord> records;
  std::vector<int> unread;
};
/// Empty before the first mark.
compmark::Result<KeptRecords> read_record(const std::filesystem::path& path);
/// mark.json of a run; nothing if it is no record or was damaged.
std::optional<MarkRecord> read_mark(const std::filesystem::path& path);

/// SHA-256 of the tensors of a decoder: name, type, shape and numbers of each, by name. Notes and other metadata are no
/// part of it.
std::string tensors_sha256(const compmark::SafetensorsFile& file);

/// <key>.record beside the key file itself, links followed; empty for a key that is no file.
std::filesystem::path key_record(const std::filesystem::path& key);
void add_record_read(FileUse& use, const std::filesystem::path& key, const std::filesystem::path& model = {});
void add_record_written(FileUse& use, const std::filesystem::path& key);

/// Warns on stderr if a record cannot be kept beside the key. Called before hours of work.
void warn_of_record(const std::filesystem::path& key, const std::filesystem::path& run);
/// Notes a mark in both places. The key's folder may be read-only, which is a warning; the run's may not.
compmark::Result<compmark::Done> keep_record(const MarkRecord& record, const std::filesystem::path& key,
                                             const std::filesystem::path& run);

/// An error if the key has recorded marks and none of them is read by this decoder. Only marks of this model count
/// where the record has it; `model` may be empty.
compmark::Result<compmark::Done> check_recorded(const std::filesystem::path& key_file, const compmark::OwnerKey& key,
                                                const std::filesystem::path& decoder,
                                                const std::filesystem::path& model = {});

}  // namespace tool
