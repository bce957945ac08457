// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// PLY files: ASCII and binary of both byte orders, any scalar types, any properties in any order, list properties
// skipped, comments and CRLF accepted. No count is believed before the file is long enough for it. Writing: binary
// little-endian columns of floats. Cost of reading: one pass over the bytes; of column(): one conversion a value.
// Longer than 300 lines: header, both encodings and the writer share one table of scalar types.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/file_kind.hpp"

namespace compmark {

static_assert(std::endian::native == std::endian::little, "io/ply.hpp assumes a little-endian machine");

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

/// Bytes of one value.
[[nodiscard]] constexpr std::size_t ply_size(PlyType type) {
  constexpr std::array<std::size_t, 8> sizes{1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(type)];
}

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;
  std::size_t offset = 0;                  ///< bytes from the start of a row; unused for lists
  std::optional<PlyType> list_count = {};  ///< set for a list property: type of its length. Its values are not kept.
  PlyType declared = type;                 ///< what the header says; rows of an ASCII file hold float64, all of them
};

/// Rows of one element, scalars only, in the machine's byte order.
struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::size_t stride = 0;  ///< bytes a row
  std::vector<PlyProperty> properties;
  std::vector<std::byte> rows;

  [[nodiscard]] const PlyProperty* find(std::string_view property) const {
    const auto found = std::find_if(properties.begin(), properties.end(),
                                    [&](const PlyProperty& p) { return p.name == property && !p.list_count; });
    return found == properties.end() ? nullptr : &*found;
  }
  /// The values of a scalar property, converted to T. The property must exist (see find).
  template <class T>
  [[nodiscard]] std::vector<T> column(std::string_view property) const;
};

struct PlyFile {
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  ///< without the word "comment"

  [[nodiscard]] const PlyElement* find(std::string_view element) const {
    const auto found =
        std::find_if(elements.begin(), elements.end(), [&](const PlyElement& e) { return e.name == element; });
    return found == elements.end() ? nullptr : &*found;
  }
};

namespace detail {

[[nodiscard]] inline std::optional<PlyType> ply_type(std::string_view name) {
  constexpr std::array<std::array<std::string_view, 2>, 8> names{{{"char", "int8"},
                                                                  {"uchar", "uint8"},
                                                                  {"short", "int16"},
                                                                  {"ushort", "uint16"},
                                                                  {"int", "int32"},
                                                                  {"uint", "uint32"},
                                                                  {"float", "float32"},
                                                                  {"double", "float64"}}};
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (name == names[i][0] || name == names[i][1]) return static_cast<PlyType>(i);
  }
  return std::nullopt;
}

template <class T>
[[nodiscard]] T load_value(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof(T));
  return value;
}
[[nodiscard]] inline double ply_value(const std::byte* from, PlyType type) {
  switch (type) {
    case PlyType::int8:
      return load_value<std::int8_t>(from);
    case PlyType::uint8:
      return load_value<std::uint8_t>(from);
    case PlyType::int16:
      return load_value<std::int16_t>(from);
    case PlyType::uint16:
      return load_value<std::uint16_t>(from);
    case PlyType::int32:
      return load_value<std::int32_t>(from);
    case PlyType::uint32:
      return load_value<std::uint32_t>(from);
    case PlyType::float32:
      return static_cast<double>(load_value<float>(from));
    case PlyType::float64:
      break;
  }
  return load_value<double>(from);
}

[[nodiscard]] inline std::vector<std::string_view> split_words(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t i = 0; i < line.size();) {
    if (line[i] == ' ' || line[i] == '\t' || line[i] == '\r') {
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < line.size() && line[end] != ' ' && line[end] != '\t' && line[end] != '\r') ++end;
    words.push_back(line.substr(i, end - i));
    i = end;
  }
  return words;
}

/// Reads one PLY from memory; a small parser object keeps the place for the messages.
class PlyParser {
 public:
  PlyParser(std::span<const std::byte> bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  [[nodiscard]] Result<PlyFile> parse() {
    if (Result<Done> header = parse_header(); !header) return header.error();
    for (PlyElement& element : file_.elements) {
      if (Result<Done> body = format_ == Format::ascii ? parse_ascii(element) : parse_binary(element); !body)
        return body.error();
    }
    return std::move(file_);
  }

 private:
  enum class Format { ascii, little, big };

  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem, std::string remedy) const {
    return {kind, name_, std::move(field), std::move(problem), std::move(remedy)};
  }
  [[nodiscard]] Error truncated(const PlyElement& element) const {
    return error(ErrorKind::truncated, "element " + element.name,
                 "the file ends before the " + std::to_string(element.count) + " rows its header promises",
                 "copy or export it again");
  }
  [[nodiscard]] std::optional<std::string_view> next_line() {
    if (position_ >= bytes_.size()) return std::nullopt;
    const char* begin = reinterpret_cast<const char*>(bytes_.data()) + position_;
    const void* newline = std::memchr(begin, line_end_, bytes_.size() - position_);
    std::size_t length = newline != nullptr ? static_cast<std::size_t>(static_cast<const char*>(newline) - begin)
                                            : bytes_.size() - position_;
    position_ = std::min(position_ + length + 1, bytes_.size());  // the last line may lack its newline
    if (length > 0 && begin[length - 1] == '\r') --length;
    return std::string_view(begin, length);
  }

  [[nodiscard]] Result<Done> parse_header() {
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
    if (text.substr(0, 3) == "\xEF\xBB\xBF") position_ = 3;  // the byte order mark of an editor
    if (text.substr(position_, 4) == "ply\r" && text.substr(position_ + 4, 1) != "\n") line_end_ = '\r';
    std::optional<std::string_view> line = next_line();
    if (!line || *line != "ply")
      return error(ErrorKind::malformed, "line 1", "does not say \"ply\", so this is not a PLY file",
                   "give a PLY file");
    bool has_format = false;
    for (std::size_t number = 2; (line = next_line()); ++number) {
      const auto bad = [&](std::string problem) {
        return error(ErrorKind::malformed, "header line " + std::to_string(number), std::move(problem),
                     "export the file again");
      };
      const std::vector<std::string_view> words = split_words(*line);
      if (words.empty() || words[0] == "obj_info") continue;
      if (words[0] == "end_header") {
        if (!has_format) return bad("there is no format line before the end of the header");
        return Done{};
      }
      if (words[0] == "comment") {
        file_.comments.emplace_back(line->size() > 8 ? line->substr(8) : std::string_view());
      } else if (words[0] == "format" && words.size() >= 2) {
        if (words[1] == "ascii")
          format_ = Format::ascii;
        else if (words[1] == "binary_little_endian")
          format_ = Format::little;
        else if (words[1] == "binary_big_endian")
          format_ = Format::big;
        else
          return bad("unknown format \"" + std::string(words[1]) + "\"");
        has_format = true;
      } else if (words[0] == "element" && words.size() == 3) {
        PlyElement element;
        element.name = words[1];
        const auto [end, status] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
        if (status != std::errc() || end != words[2].data() + words[2].size())
          return bad("the count \"" + std::string(words[2]) + "\" is not a number");
        file_.elements.push_back(std::move(element));
      } else if (words[0] == "property" && words.size() >= 3) {
        if (file_.elements.empty()) return bad("a property comes before the first element");
        PlyElement& element = file_.elements.back();
        const bool list = words[1] == "list";
        if (words.size() != (list ? 5u : 3u)) return bad("a property has the wrong number of words");
        const std::optional<PlyType> count_type = list ? ply_type(words[2]) : std::nullopt;
        const std::optional<PlyType> type = ply_type(words[list ? 3 : 1]);
        if (!type || (list && (!count_type || *count_type >= PlyType::float32)))
          return bad("unknown type in \"" + std::string(*line) + "\"");
        element.properties.push_back({std::string(words.back()), *type, element.stride, count_type});
        if (!list) element.stride += ply_size(*type);
      } else {
        return bad("cannot read \"" + std::string(line->substr(0, 60)) + "\"");
      }
    }
    return error(ErrorKind::truncated, "header", "has no end_header line", "copy or export it again");
  }

  /// Every row takes at least this many bytes of the file, so that the count can be checked before memory is taken.
  [[nodiscard]] bool plausible(const PlyElement& element) const {
    std::size_t least = format_ == Format::ascii ? 2 * element.properties.size() : element.stride;
    if (format_ != Format::ascii) {
      for (const PlyProperty& p : element.properties) least += p.list_count ? ply_size(*p.list_count) : 0;
    }
    const std::size_t left = bytes_.size() - position_ + 1;  // the last ASCII line may lack its newline
    return element.count == 0 || (least > 0 && element.count <= left / least);
  }

  [[nodiscard]] Result<Done> parse_binary(PlyElement& element) {
    if (!plausible(element)) return truncated(element);
    element.rows.resize(element.count * element.stride);
    std::byte* out = element.rows.data();
    const auto take = [&](PlyType type, std::byte* to) {
      const std::size_t size = ply_size(type);
      if (bytes_.size() - position_ < size) return false;
      std::memcpy(to, bytes_.data() + position_, size);
      if (format_ == Format::big) std::reverse(to, to + size);
      position_ += size;
      return true;
    };
    for (std::size_t row = 0; row < element.count; ++row) {
      for (const PlyProperty& property : element.properties) {
        if (!property.list_count) {
          if (!take(property.type, out)) return truncated(element);
          out += ply_size(property.type);
          continue;
        }
        std::array<std::byte, 8> length{};
        if (!take(*property.list_count, length.data())) return truncated(element);
        const double items = ply_value(length.data(), *property.list_count);
        const std::size_t left = (bytes_.size() - position_) / ply_size(property.type);
        if (items < 0 || items > static_cast<double>(left)) return truncated(element);
        position_ += static_cast<std::size_t>(items) * ply_size(property.type);
      }
    }
    return Done{};
  }

  [[nodiscard]] Result<Done> parse_ascii(PlyElement& element) {
    if (!plausible(element)) return truncated(element);
    for (PlyProperty& property : element.properties)
      property.type = PlyType::float64;  // rows hold doubles: exact for every other type
    element.stride = 0;
    for (PlyProperty& property : element.properties) {
      property.offset = element.stride;
      if (!property.list_count) element.stride += sizeof(double);
    }
    element.rows.resize(element.count * element.stride);
    for (std::size_t row = 0; row < element.count;) {
      const std::optional<std::string_view> line = next_line();
      if (!line) return truncated(element);
      const std::vector<std::string_view> words = split_words(*line);
      if (words.empty()) continue;
      std::size_t word = 0;
      for (const PlyProperty& property : element.properties) {
        double value = 0;
        if (word >= words.size() || !number(words[word++], value)) return bad_row(element, row);
        if (property.list_count) {
          if (!(value >= 0) || value > static_cast<double>(words.size() - word)) return bad_row(element, row);
          word += static_cast<std::size_t>(value);
        } else {
          std::memcpy(element.rows.data() + row * element.stride + property.offset, &value, sizeof value);
        }
      }
      ++row;
    }
    return Done{};
  }
  static bool number(std::string_view word, double& value) {
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
    return status == std::errc() && end == word.data() + word.size();
  }
  [[nodiscard]] Error bad_row(const PlyElement& element, std::size_t row) const {
    return error(ErrorKind::malformed, "element " + element.name + " row " + std::to_string(row),
                 "has too few numbers or one that cannot be read", "correct the line or export it again");
  }

  std::span<const std::byte> bytes_;
  std::string name_;
  std::size_t position_ = 0;
  char line_end_ = '\n';
  Format format_ = Format::ascii;
  PlyFile file_;
};

}  // namespace detail

template <class T>
std::vector<T> PlyElement::column(std::string_view property) const {
  const PlyProperty* found = find(property);
  COMPMARK_ASSERT(found != nullptr, "PlyElement::column: no such property");
  std::vector<T> values(count);
  for (std::size_t i = 0; i < count; ++i)
    values[i] = static_cast<T>(detail::ply_value(rows.data() + i * stride + found->offset, found->type));
  return values;
}

/// Reads a PLY in memory; `name` is for the messages.
[[nodiscard]] inline Result<PlyFile> parse_ply(std::span<const std::byte> bytes, const std::string& name) {
  return detail::PlyParser(bytes, name).parse();
}
[[nodiscard]] inline Result<PlyFile> read_ply(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes =
      read_file_of(path, std::uintmax_t{1} << 40, "a PLY file",
                   [](FileKind kind, std::span<const std::byte>) { return kind == FileKind::ply; });
  if (!bytes) return bytes.error();
  return parse_ply(*bytes, path.string());
}

/// One property to write: value i is data[i * stride].
struct PlyFloatColumn {
  std::string name;
  const float* data = nullptr;
  std::size_t stride = 1;
};

/// Writes element `vertex` of `count` rows, binary little-endian floats in the order of the columns, whole or not at
/// all.
[[nodiscard]] inline Result<Done> write_ply(const std::filesystem::path& path, std::size_t count,
                                            std::span<const PlyFloatColumn> columns,
                                            std::span<const std::string> comments = {}) {
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : comments) header += "comment " + comment + "\n";
  header += "element vertex " + std::to_string(count) + "\n";
  for (const PlyFloatColumn& column : columns) header += "property float " + column.name + "\n";
  header += "end_header\n";
  Result<AtomicFile> file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(std::string_view(header));
  constexpr std::size_t block = 4096;  // rows gathered at a time
  std::vector<float> rows;
  for (std::size_t begin = 0; begin < count; begin += block) {
    const std::size_t end = std::min(count, begin + block);
    rows.resize((end - begin) * columns.size());
    for (std::size_t c = 0; c < columns.size(); ++c) {
      for (std::size_t i = begin; i < end; ++i)
        rows[(i - begin) * columns.size() + c] = columns[c].data[i * columns[c].stride];
    }
    file->write(std::as_bytes(std::span<const float>(rows)));
  }
  return file->commit();
}

}  // namespace compmark
