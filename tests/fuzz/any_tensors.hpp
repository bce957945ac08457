// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any change of a tensor file with a right checksum, because a fuzzer does not guess one: metadata, types, shapes,
// numbers. And the law of the checksum itself on the way: one byte changed afterwards is found, or changes nothing that
// is read.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <compmark/io/safetensors.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace compmark::testing {

/// What the fuzzer gives, piece by piece; zeros at its end.
class FuzzInput {
 public:
  FuzzInput(const std::uint8_t* data, std::size_t size) : data_(data, size) {}
  [[nodiscard]] bool empty() const { return data_.empty(); }
  std::size_t byte() {
    if (data_.empty()) return 0;
    const std::size_t value = data_[0];
    data_ = data_.subspan(1);
    return value;
  }
  std::size_t word() {
    const std::size_t high = byte();
    return 256 * high + byte();
  }
  std::span<const std::byte> bytes(std::size_t count) {
    const auto taken = std::as_bytes(data_.first(std::min(count, data_.size())));
    data_ = data_.subspan(taken.size());
    return taken;
  }
  std::string text(std::size_t count) {
    const auto taken = bytes(count);
    return {reinterpret_cast<const char*>(taken.data()), taken.size()};
  }
  std::span<const std::byte> rest() { return bytes(data_.size()); }

 private:
  std::span<const std::uint8_t> data_;
};

/// A folder of this process, for readers that take a path.
inline std::filesystem::path fuzz_folder() {
  std::string name = (std::filesystem::temp_directory_path() / "compmark_fuzz_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) std::abort();
  return name;
}
/// Nothing of AtomicFile's care: a fuzzer writes a thousand files a second.
inline void put_bytes(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) std::abort();
}

inline void require_words(const Error& error) {
  if (error.problem.empty() || error.line().find('\n') != std::string::npos) std::abort();
}

[[nodiscard]] inline bool same_tensors(const SafetensorsFile& a, const SafetensorsFile& b) {
  return a.metadata == b.metadata && std::equal(a.tensors.begin(), a.tensors.end(), b.tensors.begin(), b.tensors.end(),
                                                [](const auto& x, const auto& y) {
                                                  return x.first == y.first && x.second.dtype == y.second.dtype &&
                                                         x.second.shape == y.second.shape &&
                                                         std::ranges::equal(x.second.data, y.second.data);
                                                });
}

/// A tensor file in its parts.
struct LooseTensors {
  struct Tensor {
    std::string dtype;
    std::vector<std::int64_t> shape;
    std::vector<std::byte> data;

    /// As many bytes as the shape asks for; false if that is too much.
    bool fit() {
      std::uint64_t wanted = safetensors_element_size(dtype);
      for (const std::int64_t extent : shape) wanted *= static_cast<std::uint64_t>(extent);
      if (wanted > limit) return false;
      data.resize(static_cast<std::size_t>(wanted));
      return true;
    }
  };
  static constexpr std::size_t limit = std::size_t{1} << 20;

  std::map<std::string, std::string> metadata;
  std::map<std::string, Tensor> tensors;

  LooseTensors() = default;
  explicit LooseTensors(const SafetensorsFile& file) : metadata(file.metadata) {
    for (const auto& [name, tensor] : file.tensors)
      tensors[name] = {tensor.dtype, tensor.shape, {tensor.data.begin(), tensor.data.end()}};
  }

  /// One change; what makes no sense changes nothing.
  void change(FuzzInput& input) {
    const std::size_t kind = input.byte() % 8, which = input.byte();
    if (kind < 3) {
      if (metadata.empty()) return;
      const auto entry = std::next(metadata.begin(), static_cast<std::ptrdiff_t>(which % metadata.size()));
      std::string& value = entry->second;
      if (kind == 0) {
        value = input.text(input.byte() % 64);
      } else if (kind == 1) {  // a few letters within
        const std::size_t begin = input.word() % (value.size() + 1), removed = input.byte() % 16;
        value.replace(begin, removed, input.text(input.byte() % 16));
      } else if (input.byte() % 2 == 0) {
        metadata.erase(entry);
      } else {
        metadata[input.text(input.byte() % 16)] = input.text(input.byte() % 16);
      }
      return;
    }
    if (tensors.empty()) return;
    const auto entry = std::next(tensors.begin(), static_cast<std::ptrdiff_t>(which % tensors.size()));
    Tensor tensor = entry->second;
    if (kind == 3) {
      tensors.erase(entry);
      return;
    }
    if (kind == 4) {  // numbers
      if (tensor.data.empty()) return;
      const std::size_t at = input.word() % tensor.data.size();
      const auto bytes = input.bytes(std::min<std::size_t>(1 + input.byte() % 8, tensor.data.size() - at));
      std::copy(bytes.begin(), bytes.end(), tensor.data.begin() + static_cast<std::ptrdiff_t>(at));
    } else if (kind == 5) {
      if (tensor.shape.empty()) return;
      tensor.shape[input.byte() % tensor.shape.size()] = static_cast<std::int64_t>(input.word());
    } else if (kind == 6) {
      constexpr const char* types[] = {"F64", "F32", "F16", "BF16", "I64", "I32", "U8", "BOOL"};
      tensor.dtype = types[input.byte() % 8];
    } else if (input.byte() % 2 == 0) {
      tensor.shape.push_back(static_cast<std::int64_t>(input.byte() % 4));
    } else {
      tensors[input.text(input.byte() % 32)] = tensor;
      return;
    }
    if (tensor.fit()) entry->second = std::move(tensor);
  }

  /// The file, with a right checksum; empty where a name or a word is no UTF-8.
  [[nodiscard]] std::vector<std::byte> bytes() const {
    SafetensorsWriter writer;
    writer.metadata = metadata;
    for (const auto& [name, tensor] : tensors) writer.add(name, tensor.dtype, tensor.shape, tensor.data);
    const Result<std::string> header = writer.header();
    if (!header) return {};
    const auto head = std::as_bytes(std::span<const char>(header->data(), header->size()));
    std::vector<std::byte> file(head.begin(), head.end());
    for (const std::size_t size : {8u, 4u, 2u, 1u}) {  // the writer's order
      for (const auto& [name, tensor] : tensors) {
        if (safetensors_element_size(tensor.dtype) == size)
          file.insert(file.end(), tensor.data.begin(), tensor.data.end());
      }
    }
    return file;
  }
};

/// The bytes of one of some good files, changed as the input says, or of a file that is all the input's; empty where
/// there is none.
inline std::vector<std::byte> any_tensor_file(const std::vector<LooseTensors>& good, FuzzInput& input) {
  const std::size_t choice = input.byte();
  const std::size_t damaged = input.word() * 256 + input.byte();
  LooseTensors loose;
  if (choice >= 192) {
    const auto rest = input.rest();
    const auto file = parse_safetensors({rest.begin(), rest.end()}, "fuzz");
    if (!file) {
      require_words(file.error());
      return {};
    }
    loose = LooseTensors(*file);
  } else {
    loose = good[choice % good.size()];
    while (!input.empty()) loose.change(input);
  }
  loose.metadata.erase(std::string(checksum_key));
  std::vector<std::byte> bytes = loose.bytes();
  if (bytes.empty()) return {};
  const auto file = parse_safetensors(bytes, "fuzz");
  if (!file) {  // only where another word looks as a checksum does, or a name is "__metadata__"
    const bool odd = loose.tensors.contains("__metadata__") ||
                     std::any_of(loose.metadata.begin(), loose.metadata.end(),
                                 [](const auto& entry) { return looks_like_checksum(entry.second); });
    if (!odd) std::abort();
    return {};
  }
  std::vector<std::byte> bad = bytes;
  bad[damaged % bad.size()] ^= static_cast<std::byte>(1 + damaged % 255);
  const auto read = parse_safetensors(std::move(bad), "fuzz");
  if (read.ok() && !same_tensors(*read, *file)) std::abort();
  return bytes;
}

}  // namespace compmark::testing
