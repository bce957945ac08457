// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The null of the p-value: 10,000 random keys against unmarked and marked images of a lattice decoder. The law is that
// the exact interval around the measured rate holds the rate that the test claims; tests that people are tempted to use
// instead fail it.
#include "compmark/watermark/proof/calibrate.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/pretrain/pixel_embedding.hpp"
#include "compmark/watermark/proof/key.hpp"
#include "support/picture.hpp"

using namespace compmark;

namespace {

constexpr std::size_t mark_bits = 48, key_count = 10000;
constexpr int picture_side = 96;

LatticeDecoder<float> lattice() {
  LatticeSettings settings;
  settings.bits = static_cast<int>(mark_bits);
  settings.features = 96;
  settings.sigma = {1.5, 3, 6};
  LatticeWeights<float> weights(settings);
  const Random random(3, 0, random_stage("test/calibrate decoder"));
  std::uint64_t n = 0;
  const auto fill = [&](std::vector<float>& values, double scale) {
    for (float& value : values) value = static_cast<float>(scale * random.normal(n++));
  };
  fill(weights.frequency, 14);
  fill(weights.phase, 1);
  fill(weights.head, 1);
  fill(weights.bias, 0.1);  // a biased decoder: the law does not care
  return {settings, weights};
}

std::vector<float> picture(std::uint64_t seed) { return testing::textured_picture(picture_side, seed); }

ViewLogits read(const LatticeDecoder<float>& decoder, const std::vector<float>& pixels) {
  LatticeDecoder<float>::Context context;
  SerialExecutor executor;
  const Result<ViewLogits> view = read_logits(
      decoder, ImageView<const float>{pixels.data(), 3, picture_side, picture_side}, "picture", context, executor);
  REQUIRE(view.ok());
  return *view;
}

std::vector<ViewLogits> unmarked(const LatticeDecoder<float>& decoder, std::size_t count) {
  std::vector<ViewLogits> views;
  for (std::size_t v = 0; v < count; ++v) views.push_back(read(decoder, picture(v)));
  return views;
}

OwnerKey owner(std::uint64_t number) {
  Digest256 secret{};
  secret[0] = std::byte{9};
  for (std::size_t i = 0; i < 8; ++i) secret[31 - i] = static_cast<std::byte>(number >> (8 * i) & 0xFF);
  return *make_key(secret, "2026-01-31T23:59:59Z", mark_bits);
}

/// The message of an owner's key in an image, by pixel embedding at 34 dB.
std::vector<float> marked(const LatticeDecoder<float>& decoder, const OwnerKey& key) {
  const Message message = message_of(key);
  std::vector<float> signs, image = picture(1000), result(image.size());
  for (std::size_t i = 0; i < mark_bits; ++i) signs.push_back(message[i] ? 1.0f : -1.0f);
  PixelEmbedding<LatticeDecoder<float>> embedding;
  PixelEmbeddingSettings settings;
  settings.steps = 80;
  settings.temperature = 20;
  settings.psnr = 34;
  settings.augmentation = no_augmentation();
  SerialExecutor executor;
  const auto no_jpeg = [](auto&&...) {};
  embedding.embed(decoder, ImageView<const float>{image.data(), 3, picture_side, picture_side},
                  std::span<const float>(signs), settings, 1, no_jpeg,
                  ImageView<float>{result.data(), 3, picture_side, picture_side}, executor);
  for (float& value : result) value = std::round(std::fmin(std::fmax(value, 0.0f), 1.0f) * 255) / 255;
  return result;
}

/// The law, for any test that claims a p-value: hits among the keys at a claimed rate that the test itself can attain.
template <class PValue>
bool null_holds(const PValue& p_value, double nominal, double claimed) {
  std::size_t hits = 0;
  for (std::size_t key = 0; key < key_count; ++key)
    hits += p_value(random_message(77, key, mark_bits)) <= nominal ? 1 : 0;
  return clopper_pearson(hits, key_count).contains(claimed);
}

}  // namespace

TEST_CASE("proof/calibrate: 10,000 random keys keep the rates on unmarked and on marked images") {
  const LatticeDecoder<float> decoder = lattice();
  std::vector<ViewLogits> views = unmarked(decoder, 20);
  const auto draw = [](std::size_t key) { return random_message(5, key, mark_bits); };
  for (const bool with_mark : {false, true}) {
    if (with_mark) views = {read(decoder, marked(decoder, owner(1)))};
    const Result<NullCalibration> result = calibrate_null(views, {}, draw);
    REQUIRE(result.ok());
    INFO(calibration_text(*result));
    CHECK(result->holds());
    for (const std::vector<NullRate>* rates : {&result->single, &result->fused}) {
      CHECK((*rates)[0].threshold == 33);
      CHECK((*rates)[1].threshold == 36);
      CHECK((*rates)[0].exact == binomial_tail(33, 48));
      CHECK((*rates)[0].hits > 30);  // expected 66
    }
    std::size_t total = 0;
    for (const std::size_t n : result->histogram) total += n;
    CHECK(total == key_count);
  }
}

TEST_CASE("proof/calibrate: on a marked image the owner's key is detected, those of 10,000 others are not") {
  const LatticeDecoder<float> decoder = lattice();
  const std::vector<ViewLogits> views{read(decoder, marked(decoder, owner(1)))};
  const Result<Verification> right = verify_message(message_of(owner(1)), views);
  REQUIRE(right.ok());
  CHECK(right->verdict == Verdict::detected);
  CHECK(right->evidence.matches >= 46);
  std::size_t most = 0;
  const auto draw = [](std::size_t key) { return message_of(owner(key + 2)); };  // the whole derivation of a key file
  for (std::size_t key = 0; key < key_count; ++key) most = std::max(most, matches<double>(draw(key), views[0].logits));
  CHECK(most < 41);
  const Result<NullCalibration> result = calibrate_null(views, {}, draw);
  REQUIRE(result.ok());
  CHECK(result->holds());
}

TEST_CASE("proof/calibrate: tests that treat views or bits as independent fail the same law") {
  const LatticeDecoder<float> decoder = lattice();
  const std::vector<float> base = picture(3);
  std::vector<ViewLogits> views;  // twelve views of one scene: one picture with a little noise
  for (std::size_t v = 0; v < 12; ++v) {
    const Random noise(v, 0, random_stage("test/calibrate noise"));
    std::vector<float> pixels = base;
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] += 0.01f * static_cast<float>(noise.normal(i));
    views.push_back(read(decoder, pixels));
  }
  std::vector<double> fused(mark_bits);
  fuse_logits(views, FusionRule::scaled, fused);
  const auto right = [&](const Message& m) { return evidence_of(m, fused).p_value; };
  const auto product = [&](const Message& m) {  // p-values multiplied as if independent
    double p = 1;
    for (const ViewLogits& view : views) p *= evidence_of(m, view.logits).p_value;
    return p;
  };
  const auto fisher =
      [&](const Message& m) {  // Fisher's method: -2 sum log p ~ chi^2 with 2 V degrees, as if independent
        double half = 0, term = 1, sum = 0;
        for (const ViewLogits& view : views) half -= std::log(evidence_of(m, view.logits).p_value);
        for (std::size_t k = 0; k < views.size(); ++k) {
          if (k > 0) term *= half / static_cast<double>(k);
          sum += term;
        }
        return std::exp(-half) * sum;
      };
  const auto pooled = [&](const Message& m) {  // all bits of all views as one long message
    std::size_t count = 0;
    for (const ViewLogits& view : views) count += matches<double>(m, view.logits);
    return binomial_tail(count, mark_bits * views.size());
  };
  const std::vector<ViewLogits> others = unmarked(decoder, 20);
  const auto best = [&](const Message& m) {  // the best of some images, without counting the choice
    double p = 1;
    for (const ViewLogits& view : others) p = std::fmin(p, evidence_of(m, view.logits).p_value);
    return p;
  };
  for (const double nominal : {1e-2, 1e-3}) {
    const double exact = binomial_tail(*match_threshold(mark_bits, nominal), mark_bits);
    CHECK(null_holds(right, nominal, exact));
    CHECK_FALSE(null_holds(product, nominal, nominal));
    CHECK_FALSE(null_holds(fisher, nominal, nominal));
    CHECK_FALSE(null_holds(pooled, nominal, nominal));
    CHECK_FALSE(null_holds(best, nominal, exact));
  }
  const Result<NullCalibration> result =
      calibrate_null(views, {}, [](std::size_t key) { return random_message(5, key, mark_bits); });
  REQUIRE(result.ok());
  CHECK(result->images_worth < 2);  // twelve views, hardly more than one piece of evidence
}

TEST_CASE("proof/calibrate: a key that was chosen after a look at images fails, which is what the commitment is for") {
  const LatticeDecoder<float> decoder = lattice();
  const std::vector<ViewLogits> views = unmarked(decoder, 20);
  std::vector<double> fused(mark_bits);
  fuse_logits(views, FusionRule::scaled, fused);
  const Message common = Message::from_logits<double>(fused);  // what the biased decoder likes to read
  std::size_t hits = 0;
  for (std::size_t v = 0; v < 200; ++v) {  // other images
    if (evidence_of(common, read(decoder, picture(50 + v)).logits).p_value <= 1e-2) ++hits;
  }
  CHECK(clopper_pearson(hits, 200).low > 0.1);  // claimed: at most 0.01
}

TEST_CASE(
    "proof/calibrate: a decoder that was made after the key reads its message everywhere, which is why its hash is "
    "published first") {
  const Message message = message_of(owner(1));
  LatticeDecoder<float> decoder = lattice();
  for (std::size_t i = 0; i < mark_bits; ++i) decoder.weights().bias[i] = message[i] ? 100.0f : -100.0f;
  const std::vector<ViewLogits> views = unmarked(decoder, 3);
  const Result<Verification> claimed = verify_message(message, views);
  REQUIRE(claimed.ok());
  CHECK(claimed->verdict == Verdict::detected);  // in pictures that carry nothing: the hypothesis is not met
  const Result<NullCalibration> result =         // other keys are safe from it all the same
      calibrate_null(views, {}, [](std::size_t key) { return random_message(5, key, mark_bits); });
  REQUIRE(result.ok());
  CHECK(result->holds());
}

TEST_CASE("proof/calibrate: images of independent fair bits are worth their number, copies are worth one") {
  const std::size_t count = 400;
  std::vector<ViewLogits> views(count);
  const Random random(8, 0, random_stage("test/calibrate fair"));
  for (std::size_t v = 0; v < count; ++v) {
    for (std::size_t i = 0; i < mark_bits; ++i) views[v].logits.push_back(random.normal(mark_bits * v + i));
  }
  CalibrationSettings settings;
  settings.keys = 100;
  const auto draw = [](std::size_t key) { return random_message(5, key, mark_bits); };
  Result<NullCalibration> result = calibrate_null(views, settings, draw);
  REQUIRE(result.ok());
  CHECK(result->images_worth > 250);       // sum of 48 squares of mean 1 / 400: relative spread sqrt(2 / 48) = 0.2
  CHECK(result->mean_correlation < 0.06);  // sqrt(2 / (pi 400)) = 0.04
  for (ViewLogits& view : views) view = views[0];
  result = calibrate_null(views, settings, draw);
  REQUIRE(result.ok());
  CHECK(result->images_worth == doctest::Approx(1));
  CHECK(result->largest_bias == 0.5);
}

TEST_CASE("proof/calibrate: JSON and words have the figures; bad input is refused") {
  using Json = nlohmann::ordered_json;
  std::vector<ViewLogits> views(2);
  for (std::size_t i = 0; i < mark_bits; ++i) {
    views[0].logits.push_back(i % 2 == 0 ? 1 : -1);
    views[1].logits.push_back(i % 3 == 0 ? 1 : -1);
  }
  const auto draw = [](std::size_t key) { return random_message(5, key, mark_bits); };
  const Result<NullCalibration> result = calibrate_null(views, {}, draw);
  REQUIRE(result.ok());
  const Json json = Json::parse(calibration_json<Json>(*result).dump());
  CHECK(json["one_image"][1]["threshold_matches"] == 36);
  CHECK(json["all_images"][0]["hits"] == result->fused[0].hits);
  CHECK(json["holds"] == result->holds());
  CHECK(calibration_text(*result).find("10000 random keys, 2 images, 48 bits") != std::string::npos);
  CHECK_FALSE(calibrate_null({}, {}, draw).ok());
  CalibrationSettings none;
  none.keys = 0;
  CHECK_FALSE(calibrate_null(views, none, draw).ok());
  // Of 99 "per cent" every interval would hold every rate.
  for (const double confidence : {99.0, 1.0, 0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    CalibrationSettings settings;
    settings.confidence = confidence;
    CHECK(calibrate_null(views, settings, draw).error().field == "confidence");
  }
  for (const double rate : {0.0, 1.0, 2.0, std::numeric_limits<double>::quiet_NaN()}) {
    CalibrationSettings settings;
    settings.rates = {1e-2, rate};
    CHECK(calibrate_null(views, settings, draw).error().field == "rates");
  }
  views[1].logits[3] = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(calibrate_null(views, {}, draw).ok());
  views[1].logits.resize(5);
  CHECK_FALSE(calibrate_null(views, {}, draw).ok());
}
