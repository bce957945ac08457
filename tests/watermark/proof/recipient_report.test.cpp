// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/watermark/proof/recipient_report.hpp>
#include <nlohmann/json.hpp>
#include <string>

using namespace compmark;

TEST_CASE("proof/recipient_report: names are told where the owner is proven, and with what they were corrected for") {
  Verification v;
  v.bits = 48;
  v.recipients = RecipientTrace{};
  RecipientTrace& trace = *v.recipients;
  trace.recipients = 100;
  trace.shared_bits = trace.naming_bits = 24;
  trace.rate = 1e-3;
  trace.nearest = {17, 24, 6e-8, 6e-6};
  trace.named = {trace.nearest};
  CHECK(recipients_json<nlohmann::json>(trace)["named"].empty());
  CHECK(detail::recipient_lines(v).find("nobody is named") != std::string::npos);
  CHECK(detail::recipient_lines(v).find("17") == std::string::npos);
  trace.owner_proven = true;  // by a spread mark as well as by the message
  CHECK(recipients_json<nlohmann::json>(trace)["named"][0]["recipient"] == 17);
  CHECK(detail::recipient_lines(v).find("17: 24 of the 24 bits") != std::string::npos);
  CHECK(detail::recipient_lines(v).find("corrected for 100 recipients 6e-06") != std::string::npos);
  v.settings.tries = 2;
  CHECK(detail::recipient_lines(v).find("corrected for 100 recipients and 2 tests 6e-06") != std::string::npos);
  trace.named.clear();
  CHECK(detail::recipient_lines(v).find("no single recipient can be named") != std::string::npos);
  CHECK(detail::recipient_lines(v).find("undecided") == std::string::npos);
  trace.undecided = 6;  // a quarter
  CHECK(detail::recipient_lines(v).find("undecided   6 of the 24 bits") != std::string::npos);
}
