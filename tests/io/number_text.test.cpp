// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <clocale>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/io/number_text.hpp>
#include <cstdio>
#include <limits>
#include <locale>
#include <sstream>
#include <string>

using namespace compmark;

namespace number_text_test {
namespace {

std::string printed(const char* format, double value) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

}  // namespace

TEST_CASE("io/number_text: what printf writes in the locale of C, and the shortest text that reads back") {
  const Random random(3, 0, random_stage("number_text"));
  for (std::uint64_t i = 0; i < 2'000; ++i) {
    const double value = random.normal(2 * i) * std::exp2(40 * random.normal(2 * i + 1));
    REQUIRE(detail::short_number(value) == printed("%.2g", value));
    REQUIRE(detail::short_number(value, 3) == printed("%.3g", value));
    REQUIRE(detail::fixed_number(value, 1) == printed("%.1f", value));
    REQUIRE(std::stod(detail::exact_text(value)) == value);
  }
  CHECK(detail::short_number(3.5527136788005009e-15) == "3.6e-15");
  CHECK(detail::exact_text(50) == "50");
  CHECK(detail::exact_text(0.1) == "0.1");
  CHECK(detail::fixed_number(std::numeric_limits<double>::max(), 1).size() == 311);  // 309 digits, a point, one more
  CHECK(detail::short_number(std::numeric_limits<double>::infinity()) == "inf");
}

TEST_CASE("io/number_text: nor is the comma of a program's C++ locale, which is everywhere to be had") {
  struct DecimalComma : std::numpunct<char> {
    [[nodiscard]] char do_decimal_point() const override { return ','; }
    [[nodiscard]] char do_thousands_sep() const override { return '.'; }
    [[nodiscard]] std::string do_grouping() const override { return "\3"; }
  };
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new DecimalComma));
  std::ostringstream stream;
  stream << 12345.5;
  const std::string ours =
      detail::fixed_number(12345.5, 1) + " " + detail::exact_text(12345.5) + " " + detail::short_number(12345.5, 6);
  std::locale::global(before);
  CHECK(stream.str() == "12.345,5");  // the control
  CHECK(ours == "12345.5 12345.5 12345.5");
}

TEST_CASE("io/number_text: a program's comma is no part of a number here") {
  const std::string before = std::setlocale(LC_NUMERIC, nullptr);
  const char* found = nullptr;
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "nl_NL.UTF-8"}) {
    if (found == nullptr) found = std::setlocale(LC_NUMERIC, name);
  }
  if (found == nullptr) {
    MESSAGE("skipped: no locale with a decimal comma is installed");
    return;
  }
  const std::string by_printf = printed("%.1f", 2.5), ours = detail::fixed_number(2.5, 1) + detail::exact_text(0.5);
  std::setlocale(LC_NUMERIC, before.c_str());
  CHECK(by_printf == "2,5");  // the control
  CHECK(ours == "2.50.5");
}

}  // namespace number_text_test
