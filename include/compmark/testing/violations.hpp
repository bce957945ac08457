// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a law returns: text, empty when the law holds, else one line for every violation (law, case, expected, actual),
// so that the laws need no test framework.
#pragma once

#include <string>
#include <string_view>

namespace compmark {
namespace testing {

/// Collects violations as lines of text.
class Violations {
 public:
  void expect(bool holds, std::string_view law, const std::string& what) {
    if (!holds) text_ += std::string(law) + ": " + what + "\n";
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

}  // namespace testing
}  // namespace compmark
