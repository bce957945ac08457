// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Errors of data (files, user input) are values: what went wrong, where, and what to do about it. Nothing is printed or thrown here.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "compmark/core/config.hpp"

namespace compmark::inline v0 {

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
};

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
    return text;
  }
};

/// A value or an Error. `Result<void>` is `Result<Done>`.
struct Done {};

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}      // NOLINT(google-explicit-constructor)
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] T& value() & {
    COMPMARK_ASSERT(ok(), "Result::value on an error");
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] const T& value() const& {
    COMPMARK_ASSERT(ok(), "Result::value on an error");
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] T&& value() && {
    COMPMARK_ASSERT(ok(), "Result::value on an error");
    return std::move(*std::get_if<0>(&state_));
  }
  [[nodiscard]] T& operator*() & { return value(); }
  [[nodiscard]] const T& operator*() const& { return value(); }
  [[nodiscard]] T* operator->() { return &value(); }
  [[nodiscard]] const T* operator->() const { return &value(); }
  [[nodiscard]] const Error& error() const {
    COMPMARK_ASSERT(!ok(), "Result::error on a value");
    return *std::get_if<1>(&state_);
  }

 private:
  std::variant<T, Error> state_;
};

}  // namespace compmark::inline v0
