// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Lists the options that differ between a finished run and a command that would continue it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace compmark {

/// In the words of the tool's options.
class Differences {
 public:
  using Json = nlohmann::json;

  void values(const std::string& option, const Json& before, const Json& now) {
    if (before != now) add(option, "was " + word(before) + " and is " + word(now));
  }
  /// Of files only digests are known; null where none was given.
  void files(const std::string& option, const Json& before, const Json& now) {
    if (before != now) add(option, before.is_null() ? "was not given" : now.is_null() ? "was given" : "differs");
  }
  void add(const std::string& option, const std::string& what) {
    text_ += (text_.empty() ? "" : ", ") + option + " " + what;
  }
  [[nodiscard]] bool none() const { return text_.empty(); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  static std::string word(const Json& value) {
    return value.is_null() ? std::string("not set") : value.is_string() ? value.get<std::string>() : value.dump();
  }

  std::string text_;
};

}  // namespace compmark
