// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/proof/report.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "support/decoder.hpp"

using namespace compmark;

namespace {

Message random_message(std::size_t bits) {
  const Random random(5, 0, random_stage("test/report"));
  return Message::from_words(random.bits(0), random.bits(1), bits);
}

/// Views that agree with `message` but for the first `wrong[v]` bits.
std::vector<ViewLogits> views_of(const Message& message, const std::vector<std::size_t>& wrong) {
  std::vector<ViewLogits> views;
  for (std::size_t v = 0; v < wrong.size(); ++v) {
    ViewLogits view{"view " + std::to_string(v), "ab" + std::to_string(v), {}};
    for (std::size_t i = 0; i < message.size(); ++i)
      view.logits.push_back((message[i] != (i < wrong[v]) ? 1 : -1) * (0.1 + 0.01 * static_cast<double>(i)));
    views.push_back(std::move(view));
  }
  return views;
}

VerificationReport report_of(const Message& message, const std::vector<std::size_t>& wrong,
                             const VerifySettings& settings = {}) {
  VerificationReport report{
      {"compmark test", "id", "commitment", "2026-01-31T23:59:59Z", "d.safetensors", "dd", "", "", "", "", "", ""},
      views_of(message, wrong),
      {}};
  const Result<Verification> verification = verify_message(message, report.views, settings);
  REQUIRE(verification.ok());
  report.verification = *verification;
  return report;
}

}  // namespace

TEST_CASE(
    "proof/report: logits read from an image are the decoder's, at any thread count; what cannot be read is refused") {
  const auto decoder = HiddenDecoder<>::create(testing::small_decoder(8, 8, 2));
  REQUIRE(decoder.ok());
  std::vector<float> image = testing::random_image<float>(19, 23);
  const ImageView<const float> view{image.data(), 3, 19, 23};
  HiddenDecoder<>::Context context;
  SerialExecutor serial;
  ThreadExecutor threads(3);
  std::vector<float> expected(8);
  decoder->forward(view, std::span<float>(expected), context, serial);
  const Result<ViewLogits> read = read_logits(*decoder, view, "a.png", context, threads);
  REQUIRE(read.ok());
  CHECK(read->name == "a.png");
  CHECK(read->logits == std::vector<double>(expected.begin(), expected.end()));

  const int small = decoder->minimum_size() - 1;
  const Result<ViewLogits> refused = read_logits(*decoder, {image.data(), 3, 19, small}, "b.png", context, serial);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().file == "b.png");
  CHECK(refused.error().line().find("at least " + std::to_string(small + 1)) != std::string::npos);
  CHECK_FALSE(read_logits(*decoder, {image.data(), 1, 19, 23}, "grey", context, serial).ok());
  image[7] = std::numeric_limits<float>::quiet_NaN();
  CHECK_FALSE(read_logits(*decoder, view, "nan", context, serial).ok());
}

TEST_CASE("proof/report: the accuracy of views is a mean of shares and a smallest one") {
  const Message message = random_message(48);
  const BitAccuracy accuracy = bit_accuracy(report_of(message, {0, 6, 3}).verification);
  CHECK(accuracy.views == 3);
  CHECK(accuracy.mean == doctest::Approx((48 + 42 + 45) / (3.0 * 48)));
  CHECK(accuracy.min == 42.0 / 48);
  CHECK(accuracy.largest_p == binomial_tail(42, 48));
  CHECK(bit_accuracy(Verification{}).views == 0);
}

TEST_CASE("proof/report: the JSON has every number that is needed to check the verdict, in full precision") {
  using Json = nlohmann::ordered_json;
  const Message message = random_message(48);
  VerifySettings settings;
  settings.tries = 1000;
  const VerificationReport report = report_of(message, {0, 6}, settings);
  const Json json = Json::parse(report_json<Json>(report).dump());
  CHECK(json["schema"] == "compmark.verification.1");
  CHECK(json["verdict"] == "detected");
  CHECK(json["test"]["threshold_matches"] == 44);
  CHECK(json["test"]["tests_counted"] == 1000);
  CHECK(json["key"]["commitment"] == "commitment");
  CHECK(json["decoder"]["sha256"] == "dd");
  CHECK(json["model"]["sha256"].is_null());
  CHECK(json["views"][1]["sha256"] == "ab1");
  CHECK(json["bit_accuracy"]["min"] == 42.0 / 48);
  // Repeated from the file alone, with the message.
  std::vector<ViewLogits> views;
  for (const Json& view : json["views"]) views.push_back({view["name"], "", view["logits"].get<std::vector<double>>()});
  const Result<Verification> again = verify_message(message, views, settings);
  REQUIRE(again.ok());
  CHECK(again->evidence.p_value == json["p_value"].get<double>());
  CHECK(again->p_corrected == json["p_corrected"].get<double>());
  CHECK(again->fused == json["read"]["fused_logits"].get<std::vector<double>>());
  CHECK(again->read.hex() == json["read"]["hex"]);
}

TEST_CASE("proof/report: the words follow the verdict") {
  const auto text = [](std::size_t bits, std::size_t wrong, std::uint64_t tries = 1) {
    VerifySettings settings;
    settings.tries = tries;
    return report_text(report_of(random_message(bits), {wrong}, settings).verification);
  };
  CHECK(text(48, 0).find("\nDETECTED") != std::string::npos);
  CHECK(text(48, 0).find("48 of 48 bits, read from 1 view together") != std::string::npos);
  CHECK(text(48, 0).find("p-value     3.6e-15") != std::string::npos);
  CHECK(text(48, 0).find("corrected") == std::string::npos);
  CHECK(text(48, 0, 1000).find("corrected   3.6e-12, for 1000 tests") != std::string::npos);
  CHECK(text(48, 10).find("\nINCONCLUSIVE") != std::string::npos);
  CHECK(text(48, 24).find("\nNOT DETECTED") != std::string::npos);
  CHECK(text(16, 0).find("Use a longer message") != std::string::npos);
}
