// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// safetensors, reading. Every count is checked against the file first: header length, offsets, shape against bytes,
// no overlap, no gap, nothing behind the last tensor; a checksum, if there is one. Tensors are views of the bytes.
// Longer than 300 lines: what is refused is told field by field.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/checksum.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/half.hpp"
#include "compmark/io/json_shape.hpp"
#include "compmark/io/safetensors_dtype.hpp"
#include "compmark/io/sha256.hpp"

namespace compmark {

/// One tensor of a file; `data` points into the file's blob.
struct SafetensorsTensor {
  std::string dtype;
  std::vector<std::int64_t> shape;
  std::span<const std::byte> data;

  [[nodiscard]] std::size_t count() const { return data.size() / safetensors_element_size(dtype); }
};

class SafetensorsFile;

/// Parses a file's bytes; `path` is for messages.
template <class Json = nlohmann::json>
[[nodiscard]] Result<SafetensorsFile> parse_safetensors(std::vector<std::byte> bytes, std::string path);

/// A file in memory. Movable, not copyable: the tensors point into the blob.
class SafetensorsFile {
 public:
  std::string path;                             ///< for error messages
  std::map<std::string, std::string> metadata;  ///< "__metadata__"
  std::map<std::string, SafetensorsTensor> tensors;

  SafetensorsFile() = default;
  SafetensorsFile(SafetensorsFile&&) noexcept = default;
  SafetensorsFile& operator=(SafetensorsFile&&) noexcept = default;
  SafetensorsFile(const SafetensorsFile&) = delete;
  SafetensorsFile& operator=(const SafetensorsFile&) = delete;
  ~SafetensorsFile() = default;

  [[nodiscard]] bool has(const std::string& name) const { return tensors.count(name) != 0; }
  /// SHA-256 of the bytes that were parsed, 64 digits: of these, whatever has become of the file since. Linear.
  [[nodiscard]] std::string sha256() const { return Sha256{}.update(blob_).hex(); }

  /// The tensor, if it is there.
  [[nodiscard]] Result<SafetensorsTensor> tensor(const std::string& name) const {
    const auto found = tensors.find(name);
    if (found == tensors.end())
      return error(ErrorKind::invalid, name, "no such tensor", "check that this is the right kind of file");
    return found->second;
  }
  /// The tensor, if it is there and has this shape.
  [[nodiscard]] Result<SafetensorsTensor> tensor(const std::string& name, std::span<const std::int64_t> shape) const {
    Result<SafetensorsTensor> result = tensor(name);
    if (result && !std::equal(shape.begin(), shape.end(), result->shape.begin(), result->shape.end())) {
      return error(ErrorKind::invalid, name, "has shape " + text(result->shape) + ", expected " + text(shape),
                   "check that this is the right kind of file");
    }
    return result;
  }
  /// Values of a float tensor of any width (F16, BF16, F32, F64) as float.
  [[nodiscard]] Result<std::vector<float>> floats(const std::string& name) const {
    const Result<SafetensorsTensor> found = tensor(name);
    if (!found) return found.error();
    return to_floats(name, *found);
  }
  [[nodiscard]] Result<std::vector<float>> floats(const std::string& name,
                                                  std::initializer_list<std::int64_t> shape) const {
    const Result<SafetensorsTensor> found = tensor(name, std::span<const std::int64_t>(shape.begin(), shape.size()));
    if (!found) return found.error();
    return to_floats(name, *found);
  }
  /// Values of a tensor whose dtype is exactly that of T.
  template <class T>
  [[nodiscard]] Result<std::vector<T>> values(const std::string& name) const {
    const Result<SafetensorsTensor> found = tensor(name);
    if (!found) return found.error();
    if (found->dtype != safetensors_dtype<T>()) {
      return error(ErrorKind::invalid, name,
                   "has dtype " + found->dtype + ", expected " + std::string(safetensors_dtype<T>()),
                   "check that this is the right kind of file");
    }
    std::vector<T> result(found->count());
    if (!result.empty()) std::memcpy(result.data(), found->data.data(), found->data.size());
    return result;
  }
  /// A string of the metadata, if it is there.
  [[nodiscard]] Result<std::string> text_of(const std::string& key) const {
    const auto found = metadata.find(key);
    if (found == metadata.end())
      return error(ErrorKind::invalid, "__metadata__." + key, "is missing",
                   "check that this is the right kind of file");
    return found->second;
  }

 private:
  template <class>
  friend Result<SafetensorsFile> parse_safetensors(std::vector<std::byte> bytes, std::string path);

  /// Compares the checksum, where there is one, and takes it out of the metadata: it is the file's, not the reader's.
  [[nodiscard]] Result<Done> check_content(std::string_view header) {
    const auto own = metadata.find(std::string(checksum_key));
    const auto format = metadata.find("format");
    const bool ours = format != metadata.end() && format->second.starts_with("compmark");
    for (auto entry = metadata.begin(); entry != metadata.end(); ++entry) {
      const bool named = entry == own && (ours || entry->second.starts_with(checksum_prefix));
      if (!named && !looks_like_checksum(entry->second)) continue;
      TensorsChecksum content(metadata);
      for (const auto& [name, tensor] : tensors) content.add(name, tensor.dtype, tensor.shape, tensor.data);
      // Behind the header's end the format has blanks alone, which the content does not tell from line ends.
      const bool padded = header.find_first_not_of(' ', header.rfind('}') + 1) == std::string_view::npos;
      if (!padded || entry != own || content.text() != entry->second) {
        return error(ErrorKind::malformed, "__metadata__." + std::string(checksum_key),
                     "does not belong to the tensors and metadata: the file is damaged", "copy or create it again");
      }
    }
    if (own != metadata.end() && (ours || own->second.starts_with(checksum_prefix))) metadata.erase(own);
    return Done{};
  }
  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem, std::string remedy) const {
    return {kind, path, std::move(field), std::move(problem), std::move(remedy)};
  }
  template <class Shape>
  [[nodiscard]] static std::string text(const Shape& shape) {
    std::string result = "[";
    for (const std::int64_t extent : shape) result += (result.size() > 1 ? ", " : "") + std::to_string(extent);
    return result + "]";
  }
  [[nodiscard]] Result<std::vector<float>> to_floats(const std::string& name, const SafetensorsTensor& tensor) const {
    std::vector<float> result(tensor.count());
    const std::byte* source = tensor.data.data();
    const auto convert = [&](auto zero, auto to_float) {
      for (std::size_t i = 0; i < result.size(); ++i) {
        auto value = zero;
        std::memcpy(&value, source + i * sizeof(value), sizeof(value));
        result[i] = to_float(value);
      }
    };
    if (tensor.dtype == "F32") {
      convert(0.0f, [](float value) { return value; });
    } else if (tensor.dtype == "F64") {
      convert(0.0, [](double value) { return static_cast<float>(value); });
    } else if (tensor.dtype == "F16") {
      convert(std::uint16_t{}, [](std::uint16_t value) { return detail::half_to_float(value); });
    } else if (tensor.dtype == "BF16") {
      convert(std::uint16_t{},
              [](std::uint16_t value) { return std::bit_cast<float>(static_cast<std::uint32_t>(value) << 16); });
    } else {
      return error(ErrorKind::invalid, name, "has dtype " + tensor.dtype + ", expected a float type",
                   "check that this is the right kind of file");
    }
    return result;
  }

  std::vector<std::byte> blob_;  ///< moving a vector keeps its storage, so the spans of `tensors` stay valid
};

template <class Json>
[[nodiscard]] Result<SafetensorsFile> parse_safetensors(std::vector<std::byte> bytes, std::string path) {
  const std::string remedy = "the file is damaged or not a safetensors file: copy or create it again";
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem) {
    return Error{kind, path, std::move(field), std::move(problem), remedy};
  };
  constexpr std::uint64_t header_limit = 100'000'000;  // the format's own limit
  if (bytes.size() < 8)
    return fail(ErrorKind::truncated, "header length",
                "the file has " + std::to_string(bytes.size()) + " bytes, fewer than 8");
  std::uint64_t header_size = 0;
  std::memcpy(&header_size, bytes.data(), 8);
  if (header_size > header_limit)
    return fail(ErrorKind::malformed, "header length",
                std::to_string(header_size) + " is above the limit of 100000000");
  if (header_size > bytes.size() - 8) {
    return fail(ErrorKind::truncated, "header length",
                std::to_string(header_size) + " bytes announced, " + std::to_string(bytes.size() - 8) + " left");
  }

  constexpr std::uint64_t free_header = std::uint64_t{1} << 24;  // a larger one must have data to describe
  if (header_size > free_header && header_size > bytes.size() - 8 - header_size)
    return fail(ErrorKind::exhausted, "header length",
                std::to_string(header_size) + " bytes, more than the " +
                    std::to_string(bytes.size() - 8 - header_size) + " of the data");

  // nlohmann keeps the last of two equal keys, which the format forbids, and takes 70 bytes for a bracket.
  const char* text = reinterpret_cast<const char*>(bytes.data() + 8);
  const JsonShape form = json_shape({text, static_cast<std::size_t>(header_size)});
  if (form.depth > json_depth_limit) return fail(ErrorKind::malformed, "header", "is nested too deeply");
  const Json header = json_from<Json>({text, static_cast<std::size_t>(header_size)});
  if (header.is_discarded() || !header.is_object()) return fail(ErrorKind::malformed, "header", "is not a JSON object");
  if (!form.repeated.empty() || form.keys != header.size())
    return fail(ErrorKind::malformed, form.repeated.empty() ? "a name" : form.repeated, "appears twice in the header");

  SafetensorsFile file;
  file.path = path;
  file.blob_ = std::move(bytes);
  const std::span<const std::byte> data =
      std::span<const std::byte>(file.blob_).subspan(8 + static_cast<std::size_t>(header_size));
  std::vector<std::pair<std::uint64_t, std::uint64_t>> extents;
  for (const auto& [name, entry] : header.items()) {
    if (name == "__metadata__") {
      if (!entry.is_object()) return fail(ErrorKind::malformed, name, "is not an object");
      for (const auto& [key, value] : entry.items()) {
        if (!value.is_string()) return fail(ErrorKind::malformed, name + "." + key, "is not a string");
        file.metadata.emplace(key, value.template get<std::string>());
      }
      continue;
    }
    if (!entry.is_object() || !entry.contains("dtype") || !entry.contains("shape") || !entry.contains("data_offsets")) {
      return fail(ErrorKind::malformed, name, "lacks dtype, shape or data_offsets");
    }
    const Json& dtype = entry["dtype"];
    const Json& shape = entry["shape"];
    const Json& offsets = entry["data_offsets"];
    const std::size_t element = dtype.is_string() ? safetensors_element_size(dtype.template get<std::string>()) : 0;
    if (element == 0)
      return fail(
          ErrorKind::unsupported, name + ".dtype",
          (dtype.is_string() ? dtype.template get<std::string>() : std::string("the value")) + " is not a known type");
    if (!shape.is_array()) return fail(ErrorKind::malformed, name + ".shape", "is not an array");
    if (!offsets.is_array() || offsets.size() != 2 || !offsets[0].is_number_unsigned() ||
        !offsets[1].is_number_unsigned()) {
      return fail(ErrorKind::malformed, name + ".data_offsets", "is not a pair of non-negative integers");
    }
    SafetensorsTensor tensor;
    tensor.dtype = dtype.template get<std::string>();
    std::uint64_t wanted = element;
    for (const Json& extent : shape) {
      if (!extent.is_number_unsigned())
        return fail(ErrorKind::malformed, name + ".shape", "an extent is not a non-negative integer");
      const std::uint64_t n = extent.template get<std::uint64_t>();
      if (n > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) ||
          __builtin_mul_overflow(wanted, n, &wanted)) {
        return fail(ErrorKind::malformed, name + ".shape", "its product overflows");
      }
      tensor.shape.push_back(static_cast<std::int64_t>(n));
    }
    const std::uint64_t begin = offsets[0].template get<std::uint64_t>();
    const std::uint64_t end = offsets[1].template get<std::uint64_t>();
    if (begin > end) return fail(ErrorKind::malformed, name + ".data_offsets", "the end lies before the begin");
    if (end > data.size()) {
      return fail(ErrorKind::truncated, name + ".data_offsets",
                  "ends at byte " + std::to_string(end) + " of " + std::to_string(data.size()) + " data bytes");
    }
    if (end - begin != wanted) {
      return fail(ErrorKind::malformed, name + ".shape",
                  "needs " + std::to_string(wanted) + " bytes, data_offsets hold " + std::to_string(end - begin));
    }
    tensor.data = data.subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin));
    extents.emplace_back(begin, end);
    file.tensors.emplace(name, std::move(tensor));
  }
  std::sort(extents.begin(), extents.end());
  std::uint64_t reached = 0;
  for (const auto& [begin, end] : extents) {
    if (begin != reached)
      return fail(ErrorKind::malformed, "data_offsets",
                  "tensors overlap or leave a gap at byte " + std::to_string(reached));
    reached = end;
  }
  if (reached != data.size())
    return fail(ErrorKind::malformed, "data_offsets",
                std::to_string(data.size() - reached) + " bytes behind the last tensor");
  const Result<Done> whole = file.check_content({text, static_cast<std::size_t>(header_size)});
  return whole ? Result<SafetensorsFile>(std::move(file)) : whole.error();
}

/// Reads a file; one of another kind than `expected` is named for what it is. Files of other programs say nothing of
/// their kind and pass. Cost: one read of the file; nothing is copied afterwards.
template <class Json = nlohmann::json>
[[nodiscard]] Result<SafetensorsFile> read_safetensors(const std::filesystem::path& path,
                                                       FileKind expected = FileKind::safetensors) {
  const bool any = expected == FileKind::safetensors;
  auto bytes = read_file_of(path, std::uintmax_t{1} << 40, any ? "a safetensors file" : file_kind_name(expected),
                            [](FileKind kind, std::span<const std::byte>) { return is_safetensors(kind); });
  if (!bytes) return bytes.error();
  Result<SafetensorsFile> file = parse_safetensors<Json>(std::move(*bytes), path.string());
  if (!file || any) return file;
  if (const Result<Done> kind = expect_kind(*file, expected); !kind) return kind.error();
  return file;
}

}  // namespace compmark
