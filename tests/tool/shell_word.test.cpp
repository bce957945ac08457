// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/shell_word.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstdio>
#include <memory>
#include <string>

#include "tool/running.hpp"

namespace shell_word_test {

using tool::shell_word;

/// What a shell makes of a word.
std::string said_by_shell(const std::string& word) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(("printf %s " + word).c_str(), "r"), ::pclose);
  REQUIRE(pipe != nullptr);
  std::string text;
  std::array<char, 256> part{};
  while (const std::size_t got = std::fread(part.data(), 1, part.size(), pipe.get())) text.append(part.data(), got);
  return text;
}

TEST_CASE("tool/shell_word: a shell reads the name of every file as it is") {
  for (const std::string name : {"owner.key", "run 1/model.cmk", "it's", "a\"b", "$HOME", "a;b", "*", "~", "#1", "a\\b",
                                 "Räume/größe", "a&b", "(1)", "`ls`", "two\nlines", "%s", "a=b", "!"}) {
    CAPTURE(name);
    CHECK(said_by_shell(shell_word(name)) == name);
  }
  CHECK(said_by_shell(shell_word("--help")) == "./--help");
}

TEST_CASE("tool/shell_word: plain names stay as they are, and nothing is a word as well") {
  CHECK(shell_word("runs/lego_2/model.safetensors") == "runs/lego_2/model.safetensors");
  CHECK(shell_word("run 1") == "'run 1'");
  CHECK(shell_word("") == "''");
}

}  // namespace shell_word_test
