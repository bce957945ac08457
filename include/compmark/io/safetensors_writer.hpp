// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// safetensors, writing: deterministic (the same tensors and metadata give the same bytes, in whatever order they were
// added) and atomic.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/checksum.hpp"
#include "compmark/io/safetensors_dtype.hpp"

namespace compmark {

/// Collects tensors and writes them, with a checksum of their content in the metadata (checksum.hpp). Same content,
/// same bytes: tensors lie in the order (element size descending, name), which aligns all of them.
class SafetensorsWriter {
 public:
  std::map<std::string, std::string> metadata;

  /// `bytes` is not copied: it must live until write().
  void add(std::string name, std::string dtype, std::vector<std::int64_t> shape, std::span<const std::byte> bytes) {
    entries_.push_back({std::move(name), std::move(dtype), std::move(shape), bytes, {}});
  }
  /// Values are not copied: they must live until write().
  template <class T>
  void add_values(std::string name, std::vector<std::int64_t> shape, std::span<const T> values) {
    add(std::move(name), std::string(safetensors_dtype<T>()), std::move(shape), std::as_bytes(values));
  }
  template <class T>
  void add_values(std::string name, std::vector<std::int64_t> shape,
                  std::vector<T>&& values) = delete;  // a temporary: use add_copy
  /// As add, keeping a copy (for temporaries).
  template <class T>
  void add_copy(std::string name, std::vector<std::int64_t> shape, std::span<const T> values) {
    const std::span<const std::byte> bytes = std::as_bytes(values);
    entries_.push_back(
        {std::move(name), std::string(safetensors_dtype<T>()), std::move(shape), {}, {bytes.begin(), bytes.end()}});
    entries_.back().bytes = entries_.back().owned;  // a vector's storage does not move with its entry
  }

  /// The header (length, JSON, padding to 64 bytes), after which the data follow.
  template <class Json = nlohmann::json>
  [[nodiscard]] Result<std::string> header(const std::string& path = {}) {
    std::stable_sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
      const std::size_t size_a = safetensors_element_size(a.dtype);
      const std::size_t size_b = safetensors_element_size(b.dtype);
      return size_a != size_b ? size_a > size_b : a.name < b.name;
    });
    std::map<std::string, std::string> said = metadata;
    said[std::string(checksum_key)] = checksum();
    Json json = Json::object();
    json["__metadata__"] = said;
    std::uint64_t offset = 0;
    for (const Entry& entry : entries_) {
      std::uint64_t wanted = safetensors_element_size(entry.dtype);
      for (const std::int64_t extent : entry.shape) wanted *= static_cast<std::uint64_t>(extent);
      if (wanted != entry.bytes.size() || safetensors_element_size(entry.dtype) == 0) {
        return Error{ErrorKind::invalid, path, entry.name, "shape, dtype and byte count contradict each other", ""};
      }
      if (json.contains(entry.name)) return Error{ErrorKind::invalid, path, entry.name, "is written twice", ""};
      Json& tensor = json[entry.name];
      tensor["dtype"] = entry.dtype;
      tensor["shape"] = entry.shape;
      tensor["data_offsets"] = std::array<std::uint64_t, 2>{offset, offset + wanted};
      offset += wanted;
    }
    std::string text;
    try {
      text = json.dump();
    } catch (const typename Json::exception&) {
      return Error{ErrorKind::invalid, path, "__metadata__", "a name or a string is not valid UTF-8", "rename it"};
    }
    text.append((64 - (text.size() + 8) % 64) % 64, ' ');
    const std::uint64_t size = text.size();
    std::string result(8, '\0');
    std::memcpy(result.data(), &size, 8);
    return result + text;
  }

  /// Writes under a temporary name and renames (atomic_file.hpp).
  template <class Json = nlohmann::json>
  [[nodiscard]] Result<Done> write(const std::filesystem::path& path) {
    const Result<std::string> head = header<Json>(path.string());
    if (!head) return head.error();
    Result<AtomicFile> file = AtomicFile::create(path);
    if (!file) return file.error();
    file->write(*head);
    for (const Entry& entry : entries_) file->write(entry.bytes);
    return file->commit();
  }

 private:
  /// In the order of names, as the reader has them.
  [[nodiscard]] std::string checksum() const {
    std::map<std::string_view, const Entry*> sorted;
    for (const Entry& entry : entries_) sorted.emplace(entry.name, &entry);
    TensorsChecksum content(metadata);
    for (const auto& [name, entry] : sorted) content.add(name, entry->dtype, entry->shape, entry->bytes);
    return content.text();
  }

  struct Entry {
    std::string name;
    std::string dtype;
    std::vector<std::int64_t> shape;
    std::span<const std::byte> bytes;
    std::vector<std::byte> owned;
  };
  std::vector<Entry> entries_;
};

}  // namespace compmark
