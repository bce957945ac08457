// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Errors of data (files, user input) are values: what went wrong, where, and what to do about it. Nothing is printed or
// thrown here.
#pragma once

#include <memory>
#include <new>
#include <string>
#include <type_traits>
#include <utility>

#include "compmark/core/config.hpp"

namespace compmark {

/// Why an operation on outside data failed.
enum class ErrorKind {
  not_found,    ///< a file or folder is missing
  unreadable,   ///< it is there but cannot be read or decoded
  truncated,    ///< it ends before its own counts say
  malformed,    ///< its structure is not that of the format
  invalid,      ///< a value is outside its range, NaN, or contradicts another
  unsupported,  ///< valid, but of a kind that is not handled
  unwritable,   ///< the output cannot be written
  exhausted,    ///< a budget (memory, anchors, size) would be exceeded
  cancelled,    ///< an observer of the caller said stop
};

/// A text on one line: what a file says of itself (names, chunks) may hold line ends and codes that a terminal obeys.
/// They become '?'.
[[nodiscard]] inline std::string one_line(std::string text) {
  for (char& c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 32 || code == 127) c = '?';
  }
  return text;
}

/// One error: file, field and remedy, each may be empty. `line()` is what a tool prints.
struct Error {
  ErrorKind kind = ErrorKind::invalid;
  std::string file;     ///< path of the file concerned
  std::string field;    ///< field, JSON path, byte offset or line
  std::string problem;  ///< what is wrong, with the offending value
  std::string remedy;   ///< what the user can do

  [[nodiscard]] std::string line() const {
    std::string text = file;
    if (!field.empty()) text += (text.empty() ? "" : ": ") + field;
    text += (text.empty() ? "" : ": ") + problem;
    if (!remedy.empty()) text += "; " + remedy;
    return one_line(std::move(text));
  }
};

/// A value or an Error. `Result<void>` is `Result<Done>`.
struct Done {};

/// One of two, by hand: a std::variant of each of the library's results was an eighth of the time to parse its umbrella
/// header.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : value_(std::move(value)), ok_(true) {}       // NOLINT(google-explicit-constructor)
  Result(Error error) : error_(std::move(error)), ok_(false) {}  // NOLINT(google-explicit-constructor)
  Result(const Result& other) requires std::is_copy_constructible_v<T> : ok_(other.ok_) { create(other); }
  Result(Result&& other) noexcept : ok_(other.ok_) { create(std::move(other)); }
  Result& operator=(const Result& other) requires std::is_copy_constructible_v<T> { return *this = Result(other); }
  Result& operator=(Result&& other) noexcept {
    if (this == &other) return *this;
    destroy();
    ok_ = other.ok_;
    create(std::move(other));
    return *this;
  }
  ~Result() { destroy(); }

  [[nodiscard]] bool ok() const { return ok_; }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] T& value() & {
    COMPMARK_ASSERT(ok(), "Result::value on an error");
    return value_;
  }
  [[nodiscard]] const T& value() const& {
    COMPMARK_ASSERT(ok(), "Result::value on an error");
    return value_;
  }
  [[nodiscard]] T&& value() && {
    COMPMARK_ASSERT(ok(), "Result::value on an error");
    return std::move(value_);
  }
  [[nodiscard]] T& operator*() & { return value(); }
  [[nodiscard]] const T& operator*() const& { return value(); }
  [[nodiscard]] T* operator->() { return &value(); }
  [[nodiscard]] const T* operator->() const { return &value(); }
  [[nodiscard]] const Error& error() const {
    COMPMARK_ASSERT(!ok(), "Result::error on a value");
    return error_;
  }

 private:
  static_assert(std::is_nothrow_move_constructible_v<T>, "Result: the value's move must not throw");

  template <class Other>
  void create(Other&& other) {
    if (ok_) {
      ::new (static_cast<void*>(std::addressof(value_))) T(std::forward<Other>(other).value_);
    } else {
      ::new (static_cast<void*>(std::addressof(error_))) Error(std::forward<Other>(other).error_);
    }
  }
  void destroy() {
    if (ok_) {
      value_.~T();
    } else {
      error_.~Error();
    }
  }

  union {
    T value_;
    Error error_;
  };
  bool ok_;
};

}  // namespace compmark
