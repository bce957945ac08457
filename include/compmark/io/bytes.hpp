// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Numbers as little-endian bytes of stated width, whatever the machine (docs/spec/numerics.md, CO2): ByteWriter
// appends, ByteReader takes. Floats travel as their bits. A reader past its end delivers zeros and remembers it, so
// that a parser asks once at the end of a record, and gives a count only when as many elements can follow: no
// allocation is larger than the bytes that announce it.
#pragma once

#include <algorithm>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace compmark {

class ByteWriter {
 public:
  /// Any integer, in its own width.
  template <std::integral T>
  ByteWriter& put(T value) {
    using Unsigned = std::make_unsigned_t<T>;
    const Unsigned bits = static_cast<Unsigned>(value);
    for (std::size_t i = 0; i < sizeof(T); ++i) bytes_.push_back(static_cast<std::byte>(bits >> (8 * i) & 255u));
    return *this;
  }
  ByteWriter& put(float value) { return put(std::bit_cast<std::uint32_t>(value)); }
  ByteWriter& put(double value) { return put(std::bit_cast<std::uint64_t>(value)); }
  ByteWriter& put(std::span<const std::byte> bytes) {
    // Not insert(end(), ...): g++ 12 takes its move of what lies behind for one past the end of an empty vector.
    const std::size_t before = bytes_.size();
    bytes_.resize(before + bytes.size());
    std::copy(bytes.begin(), bytes.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(before));
    return *this;
  }
  /// The characters alone; their number is the caller's to write.
  ByteWriter& put(std::string_view text) { return put(std::as_bytes(std::span<const char>(text.data(), text.size()))); }

  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] const std::vector<std::byte>& bytes() const { return bytes_; }
  [[nodiscard]] std::vector<std::byte> take() { return std::exchange(bytes_, {}); }

 private:
  std::vector<std::byte> bytes_;
};

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <std::integral T>
  [[nodiscard]] T get() {
    using Unsigned = std::make_unsigned_t<T>;
    const std::span<const std::byte> source = take(sizeof(T));
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < source.size(); ++i) bits |= std::to_integer<std::uint64_t>(source[i]) << (8 * i);
    return static_cast<T>(static_cast<Unsigned>(bits));
  }
  template <std::floating_point T>
  [[nodiscard]] T get() {
    if constexpr (sizeof(T) == 4) return std::bit_cast<T>(get<std::uint32_t>());
    if constexpr (sizeof(T) == 8) return std::bit_cast<T>(get<std::uint64_t>());
  }
  /// The next bytes; empty when they are not there.
  [[nodiscard]] std::span<const std::byte> take(std::uint64_t count) {
    if (count > left()) {
      failed_ = true;
      position_ = bytes_.size();
      return {};
    }
    const std::span<const std::byte> taken = bytes_.subspan(position_, static_cast<std::size_t>(count));
    position_ += static_cast<std::size_t>(count);
    return taken;
  }
  [[nodiscard]] std::string text(std::uint64_t count) {
    const std::span<const std::byte> source = take(count);
    return {reinterpret_cast<const char*>(source.data()), source.size()};
  }
  /// A u32 count of elements of at least `element` bytes each; 0 and failed when so many cannot follow.
  [[nodiscard]] std::size_t count(std::size_t element) {
    const std::uint32_t n = get<std::uint32_t>();
    if (n > left() / (element == 0 ? 1 : element)) {
      failed_ = true;
      return 0;
    }
    return n;
  }

  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] std::size_t position() const { return position_; }
  /// Something was asked for that was not there.
  [[nodiscard]] bool failed() const { return failed_; }
  /// Everything was there, and nothing is left.
  [[nodiscard]] bool complete() const { return !failed_ && left() == 0; }

 private:
  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
  bool failed_ = false;
};

/// a * b, or false when it does not fit.
[[nodiscard]] inline bool checked_product(std::uint64_t a, std::uint64_t b, std::uint64_t& product) {
  if (a != 0 && b > std::numeric_limits<std::uint64_t>::max() / a) return false;
  product = a * b;
  return true;
}

}  // namespace compmark
