// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// NumPy's .npy files (format versions 1 to 3): a header that is a Python dictionary, then the numbers. Little-endian
// floats and integers in C order are read, as doubles, and written (version 1), as they are. No count is believed: the
// shape's product is compared with the bytes that follow before anything is allocated.
#pragma once

#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/file_kind.hpp"

namespace compmark {

/// An array of any rank, the last index running fastest.
struct NpyArray {
  std::vector<std::size_t> shape;
  std::vector<double> values;
};

namespace detail {

/// What follows the quoted key and its colon in the header, or an empty text.
[[nodiscard]] inline std::string_view npy_field(std::string_view header, std::string_view key) {
  for (std::size_t i = header.find(key); i != std::string_view::npos; i = header.find(key, i + 1)) {
    if (i == 0 || (header[i - 1] != '\'' && header[i - 1] != '"')) continue;
    std::string_view rest = header.substr(i + key.size());
    if (rest.empty() || (rest[0] != '\'' && rest[0] != '"')) continue;
    rest.remove_prefix(1);
    while (!rest.empty() && (rest[0] == ' ' || rest[0] == ':')) rest.remove_prefix(1);
    return rest;
  }
  return {};
}

template <class T>
void npy_values(std::span<const std::byte> bytes, std::vector<double>& values) {
  values.resize(bytes.size() / sizeof(T));
  for (std::size_t i = 0; i < values.size(); ++i) {
    T value;
    std::memcpy(&value, bytes.data() + i * sizeof(T), sizeof(T));
    values[i] = static_cast<double>(value);
  }
}

}  // namespace detail

/// Parses a whole file; `name` is for the message.
[[nodiscard]] inline Result<NpyArray> parse_npy(std::span<const std::byte> bytes, const std::string& name) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, name, std::move(field), std::move(problem), std::move(remedy)};
  };
  constexpr std::size_t prefix = 10;
  if (bytes.size() < prefix) {
    return fail(ErrorKind::truncated, "byte 0", "the file is too short to be an .npy file", "copy it again");
  }
  if (std::memcmp(bytes.data(), "\x93NUMPY", 6) != 0)
    return fail(ErrorKind::malformed, "byte 0", "does not begin as an .npy file does",
                "save the array with numpy.save");
  const auto at = [&](std::size_t i) { return std::to_integer<std::size_t>(bytes[i]); };
  const std::size_t format_version = at(6);
  if (format_version < 1 || format_version > 3)
    return fail(ErrorKind::unsupported, "byte 6", "has the unknown format version " + std::to_string(format_version),
                "save the array with numpy.save");
  const std::size_t begin = format_version == 1 ? prefix : prefix + 2;
  if (bytes.size() < begin) return fail(ErrorKind::truncated, "byte 8", "ends within its header", "copy it again");
  std::size_t length = at(8) | at(9) << 8;
  if (format_version > 1) length |= at(10) << 16 | at(11) << 24;
  if (length > bytes.size() - begin)
    return fail(ErrorKind::truncated, "byte 8",
                "promises a header of " + std::to_string(length) + " bytes, but the file ends before", "copy it again");
  const std::string_view header(reinterpret_cast<const char*>(bytes.data()) + begin, length);

  const std::string_view order = detail::npy_field(header, "fortran_order");
  if (!order.starts_with("False"))
    return fail(order.starts_with("True") ? ErrorKind::unsupported : ErrorKind::malformed, "fortran_order",
                "is not False", "save numpy.ascontiguousarray of the array");
  std::string_view type = detail::npy_field(header, "descr");
  type = type.size() >= 5 ? type.substr(1, 3) : std::string_view();
  const std::size_t size = type == "<f8" || type == "<i8"   ? 8
                           : type == "<f4" || type == "<i4" ? 4
                           : type == "|u1"                  ? 1
                                                            : 0;
  if (size == 0)
    return fail(ErrorKind::unsupported, "descr",
                "is a type that is not handled (little-endian f4, f8, i4, i8 or u1 are)", "save the array as float64");
  std::string_view shape = detail::npy_field(header, "shape");
  NpyArray array;
  const std::size_t available = (bytes.size() - begin - length) / size;
  const Error too_many{ErrorKind::truncated, name, "shape",
                       "promises more numbers than the " + std::to_string(available) + " that the file holds",
                       "copy it again"};
  std::size_t count = 1;
  if (!shape.starts_with("("))
    return fail(ErrorKind::malformed, "shape", "is missing", "save the array with numpy.save");
  shape.remove_prefix(1);
  while (true) {
    while (!shape.empty() && (shape[0] == ' ' || shape[0] == ',')) shape.remove_prefix(1);
    if (shape.starts_with(")")) break;
    std::uint64_t side = 0;
    const auto [end, status] = std::from_chars(shape.data(), shape.data() + shape.size(), side);
    if (status != std::errc() || array.shape.size() == 8)
      return fail(ErrorKind::malformed, "shape", "is not a list of up to 8 numbers", "save the array with numpy.save");
    shape.remove_prefix(static_cast<std::size_t>(end - shape.data()));
    if (side != 0 && count > available / side) return too_many;
    count *= static_cast<std::size_t>(side);
    array.shape.push_back(static_cast<std::size_t>(side));
  }
  if (count > available) return too_many;  // the one number of an empty shape
  const std::span<const std::byte> body = bytes.subspan(begin + length, count * size);
  if (type == "<f8") detail::npy_values<double>(body, array.values);
  if (type == "<f4") detail::npy_values<float>(body, array.values);
  if (type == "<i8") detail::npy_values<std::int64_t>(body, array.values);
  if (type == "<i4") detail::npy_values<std::int32_t>(body, array.values);
  if (type == "|u1") detail::npy_values<std::uint8_t>(body, array.values);
  return array;
}

/// NumPy's name of a number: little-endian float or double, signed integer of 4 or 8 bytes, or byte.
template <class T>
inline constexpr const char* npy_type = [] {
  static_assert(std::endian::native == std::endian::little, "npy: written in this machine's order");
  if constexpr (std::is_same_v<T, float>) return "<f4";
  if constexpr (std::is_same_v<T, double>) return "<f8";
  if constexpr (std::is_same_v<T, std::int32_t>) return "<i4";
  if constexpr (std::is_same_v<T, std::int64_t>) return "<i8";
  if constexpr (std::is_same_v<T, std::uint8_t>) return "|u1";
}();

/// The file of an array: `values` has as many numbers as `shape` says, the last index running fastest. The numbers
/// begin at a multiple of 64 bytes, as NumPy wants it.
template <class T>
[[nodiscard]] std::vector<std::byte> npy_bytes(std::span<const std::size_t> shape, std::span<const T> values) {
  std::string header = std::string("{'descr': '") + npy_type<T> + "', 'fortran_order': False, 'shape': (";
  [[maybe_unused]] std::size_t count = 1;  // asserted alone
  for (const std::size_t side : shape) {
    header += std::to_string(side) + ",";
    count *= side;
  }
  COMPMARK_ASSERT(count == values.size(), "npy_bytes: the shape and the number of values");
  header += ")}";
  header.append(63 - (10 + header.size()) % 64, ' ');
  header += '\n';
  std::string text("\x93NUMPY\x01\0", 8);
  text += static_cast<char>(header.size() & 255);
  text += static_cast<char>(header.size() >> 8);
  text += header;
  std::vector<std::byte> bytes(text.size() + values.size_bytes());
  std::memcpy(bytes.data(), text.data(), text.size());
  if (!values.empty()) std::memcpy(bytes.data() + text.size(), values.data(), values.size_bytes());
  return bytes;
}
/// Writes it, whole or not at all.
template <class T>
[[nodiscard]] Result<Done> write_npy(const std::filesystem::path& path, std::span<const std::size_t> shape,
                                     std::span<const T> values) {
  return write_file(path, std::span<const std::byte>(npy_bytes<T>(shape, values)));
}

[[nodiscard]] inline Result<NpyArray> read_npy(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes =
      read_file_of(path, std::uintmax_t{1} << 32, "a NumPy array (.npy)",
                   [](FileKind kind, std::span<const std::byte>) { return kind == FileKind::npy; });
  if (!bytes) return bytes.error();
  return parse_npy(*bytes, path.string());
}

}  // namespace compmark
