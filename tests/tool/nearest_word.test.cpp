// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/nearest_word.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "tool/running.hpp"

namespace nearest_word_test {

using tool::letters_apart;
using tool::nearest_word;

TEST_CASE("tool/nearest_word: letters put in, left out, replaced and exchanged each count one, in both directions") {
  CHECK(letters_apart("", "") == 0);
  CHECK(letters_apart("", "train") == 5);
  CHECK(letters_apart("train", "train") == 0);
  CHECK(letters_apart("trian", "train") == 1);
  CHECK(letters_apart("tran", "train") == 1);
  CHECK(letters_apart("traine", "train") == 1);
  CHECK(letters_apart("trait", "train") == 1);
  CHECK(letters_apart("kitten", "sitting") == 3);  // Levenshtein's example
  CHECK(letters_apart("ca", "abc") == 3);          // optimal string alignment; Damerau's own distance would be 2
  for (const char* a : {"verify", "evlauate", "x", ""})
    for (const char* b : {"verfy", "evaluate", "", "extract"}) CHECK(letters_apart(a, b) == letters_apart(b, a));
}

TEST_CASE("tool/nearest_word: what is near is named, and what is not is not guessed") {
  const std::vector<std::string> known{"train", "embed", "evaluate", "verify", "--iterations", "--out"};
  CHECK(nearest_word("trian", known) == "train");
  CHECK(nearest_word("eval", known).empty());  // four letters are missing
  CHECK(nearest_word("evaluat", known) == "evaluate");
  CHECK(nearest_word("--itrations", known) == "--iterations");
  CHECK(nearest_word("--outs", known) == "--out");
  CHECK(nearest_word("banana", known).empty());
  CHECK(nearest_word("", known).empty());
}

TEST_CASE("tool: a mistyped command or option is answered with the nearest one, and --version says which this is") {
  using compmark::testing::check_refused;
  using compmark::testing::tool;
  check_refused(tool("trian --data x"), {"trian", "is no command", "did you mean train?"});
  check_refused(tool("banana"), {"banana", "is no command", "compmark --help"});
  check_refused(tool("train --data x --out y --itrations 3"),
                {"--itrations", "is no option", "did you mean --iterations?"});
  check_refused(tool("verify --key=x --imagse=y"), {"--imagse", "did you mean --images?"});
  check_refused(tool("train --banana"), {"--banana", "is no option", "compmark train --help"});
  check_refused(tool("info a b c --model d"), {});
  const compmark::testing::Outcome version = tool("--version");
  CHECK(version.code == 0);
  CHECK(version.text.find("compmark 0.") == 0);
}

}  // namespace nearest_word_test
