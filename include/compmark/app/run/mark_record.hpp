// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Records of the decoders that read the marks of a key. Every hidden mark is recorded in mark.json of its run, and as a
// line of <key>.record beside the key; that file is only appended to, and the key file is never changed. A later
// reading with another decoder gives an error, because it would not find a message that is there.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/io/safetensors_reader.hpp"

namespace compmark {

/// A file by its name and the digest of its bytes.
struct RecordedFile {
  std::string name, sha256;
};
/// Which decoder reads the mark of a key, and where.
struct MarkRecord {
  std::string key_id, key_commitment;
  RecordedFile decoder;
  std::string decoder_tensors;       ///< tensors_sha256
  std::vector<RecordedFile> models;  ///< that hold the mark
  std::size_t recipient = 0;         ///< whose copy they are; 0: the key has no recipients
};

/// The marks of a record, and the lines (from 1) that are none or were damaged. Each carries a checksum of its fields.
struct KeptRecords {
  std::vector<MarkRecord> records;
  std::vector<int> unread;
};
/// Records of a file; empty before the first mark.
[[nodiscard]] Result<KeptRecords> read_record(const std::filesystem::path& path);
/// mark.json of a run; nothing if it is no record or was damaged.
[[nodiscard]] std::optional<MarkRecord> read_mark(const std::filesystem::path& path);

/// SHA-256 of the tensors of a decoder: name, type, shape and numbers of each, by name. Notes and other metadata are no
/// part of it.
[[nodiscard]] std::string tensors_sha256(const SafetensorsFile& file);

/// <key>.record beside the key file itself, links followed; empty for a key that is no file.
[[nodiscard]] std::filesystem::path key_record(const std::filesystem::path& key);

/// Warns if a record cannot be kept beside the key. Called before hours of work.
void warn_of_record(const std::filesystem::path& key, const std::filesystem::path& run, const SentenceSink& warn);
/// Notes a mark in both places. The key's folder may be read-only, which is a warning; the run's may not.
[[nodiscard]] Result<Done> keep_record(const MarkRecord& record, const std::filesystem::path& key,
                                       const std::filesystem::path& run, const SentenceSink& warn);

/// An error if the key has recorded marks and none of them is read by this decoder. Only marks of this model count
/// where the record has it; `model` may be empty. Warns of records that are damaged.
[[nodiscard]] Result<Done> check_recorded(const std::filesystem::path& key_file, const OwnerKey& key,
                                          const std::filesystem::path& decoder, const std::filesystem::path& model,
                                          const SentenceSink& warn);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/mark_record.hpp"
#endif
