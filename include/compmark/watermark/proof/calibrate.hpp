// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A check of the p-value. Random keys are tested against images that carry none of them: key i against image i mod V,
// and key i against all images together. Keys are independent, so either count of false positives is Binomial(keys, P(M
// >= threshold)) exactly, for marked and unmarked images alike. The interval of Clopper and Pearson around the measured
// false-positive rate must hold that probability, which is at most the nominal rate because matches are whole numbers.
// The report also has statistics of the decoder: the bias of its bits, the correlation between them, and the number of
// independent images that the given ones are worth as evidence about one key, bits / sum_i (mean_v b_vi)^2 with b =
// +-1. That number is why p-values of images are never multiplied. Cost: O(keys * bits).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/number_text.hpp"
#include "compmark/math/binomial.hpp"
#include "compmark/watermark/proof/message.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

struct CalibrationSettings {
  std::size_t keys = 10000;
  std::vector<double> rates{1e-2, 1e-3};
  double confidence = 0.99;  ///< of each interval
  FusionRule fusion = FusionRule::scaled;
};

/// False positives at one nominal rate.
struct NullRate {
  double nominal = 0;
  std::optional<std::size_t> threshold;  ///< matches that count as one; empty: none can
  double exact = 0;                      ///< P(M >= threshold), at most `nominal`
  std::size_t hits = 0, trials = 0;
  Interval interval{};  ///< of the measured rate

  [[nodiscard]] double rate() const { return static_cast<double>(hits) / static_cast<double>(trials); }
  /// Whether the measurement agrees with the p-value.
  [[nodiscard]] bool holds() const { return interval.contains(exact); }
};

struct NullCalibration {
  std::size_t bits = 0, images = 0, keys = 0;
  double confidence = 0;
  std::vector<NullRate> single;        ///< one image a key
  std::vector<NullRate> fused;         ///< all images together
  std::vector<std::size_t> histogram;  ///< of the matches of `single`, bits + 1 counts
  double largest_bias = 0;             ///< over the bits, |share of ones - 1/2|
  double mean_correlation = 0;         ///< over pairs of bits, |correlation of their logits|
  double largest_correlation = 0;
  double images_worth = 0;  ///< independent images that these are worth, about one key

  [[nodiscard]] bool holds() const {
    const auto good = [](const NullRate& rate) { return rate.holds(); };
    return std::all_of(single.begin(), single.end(), good) && std::all_of(fused.begin(), fused.end(), good);
  }
};

namespace detail {

/// Bias, correlations and worth.
inline void describe_logits(std::span<const ViewLogits> views, NullCalibration& result) {
  const std::size_t bits = result.bits;
  const double count = static_cast<double>(views.size());
  std::vector<double> mean(bits), deviation(bits);
  double squares = 0;
  for (std::size_t i = 0; i < bits; ++i) {
    double ones = 0;
    for (const ViewLogits& view : views) {
      ones += view.logits[i] > 0 ? 1 : 0;
      mean[i] += view.logits[i] / count;
    }
    for (const ViewLogits& view : views) deviation[i] += (view.logits[i] - mean[i]) * (view.logits[i] - mean[i]);
    deviation[i] = std::sqrt(deviation[i]);
    const double share = ones / count;
    result.largest_bias = std::max(result.largest_bias, std::abs(share - 0.5));
    squares += (2 * share - 1) * (2 * share - 1);
  }
  result.images_worth = squares > 0 ? std::min(count, static_cast<double>(bits) / squares) : count;
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < bits; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (!(deviation[i] > 0 && deviation[j] > 0)) continue;
      double sum = 0;
      for (const ViewLogits& view : views) sum += (view.logits[i] - mean[i]) * (view.logits[j] - mean[j]);
      const double correlation = std::abs(sum / (deviation[i] * deviation[j]));
      result.mean_correlation += correlation;
      result.largest_correlation = std::max(result.largest_correlation, correlation);
      ++pairs;
    }
  }
  if (pairs > 0) result.mean_correlation /= static_cast<double>(pairs);
}

}  // namespace detail

/// The message of random key number `index`.
[[nodiscard]] inline Message random_message(std::uint64_t seed, std::size_t index, std::size_t bits) {
  const Random random(seed, index, random_stage("mark/calibrate"));
  return Message::from_words(random.bits(0), random.bits(1), bits);
}

/// `message(i)` is the message of key i, independent of all others and of the images: random_message() or that of a
/// random owner key.
template <class DrawMessage>
[[nodiscard]] Result<NullCalibration> calibrate_null(std::span<const ViewLogits> views,
                                                     const CalibrationSettings& settings, const DrawMessage& message) {
  const auto fail = [](std::string field, std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, "", std::move(field), std::move(problem), std::move(remedy)};
  };
  if (views.empty()) return fail("views", "there is none", "give at least one image");
  if (settings.keys < 1) return fail("keys", "is 0", "give the number of random keys to try, as 10000");
  if (!(settings.confidence > 0 && settings.confidence < 1))
    return fail("confidence", "is not between 0 and 1", "give a share, as 0.99");
  for (const double rate : settings.rates) {
    if (!(rate > 0 && rate < 1)) return fail("rates", "has one that is not between 0 and 1", "give rates as 0.01");
  }
  NullCalibration result;
  result.bits = views[0].logits.size();
  result.images = views.size();
  result.keys = settings.keys;
  result.confidence = settings.confidence;
  if (result.bits < 1 || result.bits > message_bits_limit) return fail(views[0].name, "has no message", "read it anew");
  for (const ViewLogits& view : views) {
    const bool finite = std::all_of(view.logits.begin(), view.logits.end(), [](double z) { return std::isfinite(z); });
    if (view.logits.size() != result.bits || !finite)
      return fail(view.name, "has another number of bits, or one that is not finite", "read all with one decoder");
  }
  std::vector<double> fused(result.bits);
  fuse_logits(views, settings.fusion, fused);
  const Message together = Message::from_logits<double>(fused);
  std::vector<Message> reads;
  for (const ViewLogits& view : views) reads.push_back(Message::from_logits<double>(view.logits));
  std::vector<std::size_t> fused_histogram(result.bits + 1);
  result.histogram.resize(result.bits + 1);
  for (std::size_t key = 0; key < settings.keys; ++key) {
    const Message expected = message(key);
    ++result.histogram[expected.matches(reads[key % reads.size()])];
    ++fused_histogram[expected.matches(together)];
  }
  const auto rates = [&](const std::vector<std::size_t>& histogram, std::vector<NullRate>& to) {
    for (const double nominal : settings.rates) {
      NullRate rate{nominal, match_threshold(result.bits, nominal), 0, 0, settings.keys, {}};
      if (rate.threshold) {
        rate.exact = binomial_tail(*rate.threshold, result.bits);
        for (std::size_t k = *rate.threshold; k <= result.bits; ++k) rate.hits += histogram[k];
      }
      rate.interval = clopper_pearson(rate.hits, rate.trials, settings.confidence);
      to.push_back(rate);
    }
  };
  rates(result.histogram, result.single);
  rates(fused_histogram, result.fused);
  detail::describe_logits(views, result);
  return result;
}

/// Schema "compmark.calibration.1".
template <class Json>
[[nodiscard]] Json calibration_json(const NullCalibration& c) {
  Json json;
  json["schema"] = "compmark.calibration.1";
  json["holds"] = c.holds();
  json["bits"] = c.bits;
  json["images"] = c.images;
  json["keys"] = c.keys;
  json["confidence"] = c.confidence;
  const auto rates = [](const std::vector<NullRate>& from) {
    Json list = Json::array();
    for (const NullRate& rate : from) {
      Json entry;
      entry["nominal"] = rate.nominal;
      entry["threshold_matches"] = rate.threshold ? Json(*rate.threshold) : Json(nullptr);
      entry["exact"] = rate.exact;
      entry["hits"] = rate.hits;
      entry["rate"] = rate.rate();
      entry["interval"] = {rate.interval.low, rate.interval.high};
      entry["holds"] = rate.holds();
      list.push_back(std::move(entry));
    }
    return list;
  };
  json["one_image"] = rates(c.single);
  json["all_images"] = rates(c.fused);
  json["matches_histogram"] = c.histogram;
  json["bits_of_the_decoder"] = {{"largest_bias", c.largest_bias},
                                 {"mean_correlation", c.mean_correlation},
                                 {"largest_correlation", c.largest_correlation},
                                 {"images_worth", c.images_worth}};
  return json;
}

/// The same in words. Lines end with '\n'.
[[nodiscard]] inline std::string calibration_text(const NullCalibration& c) {
  const auto number = [](double x) { return detail::short_number(x, 3); };
  std::string text = std::to_string(c.keys) + " random keys, " + std::to_string(c.images) + " images, " +
                     std::to_string(c.bits) + " bits\n";
  const auto rates = [&](const char* what, const std::vector<NullRate>& list) {
    for (const NullRate& rate : list) {
      text += what + (" at " + number(rate.nominal)) + ": ";
      if (!rate.threshold) {
        text += "no number of matches can reach it\n";
        continue;
      }
      text += number(rate.rate()) + " measured (" + std::to_string(rate.hits) + "), " + number(100 * c.confidence) +
              " % interval " + number(rate.interval.low) + " to " + number(rate.interval.high) + ", exact " +
              number(rate.exact) + " (" + std::to_string(*rate.threshold) +
              " matches): " + (rate.holds() ? "holds" : "DOES NOT HOLD") + "\n";
    }
  };
  rates("one image ", c.single);
  rates("all images", c.fused);
  return text + "the decoder: a bit's share of ones is up to " + number(100 * c.largest_bias) +
         " points from 50 %; correlation of bits " + number(c.mean_correlation) + " in the mean, " +
         number(c.largest_correlation) + " at most; about one key, " + std::to_string(c.images) +
         " images are worth as much evidence as " + number(c.images_worth) + " independent ones\n";
}

}  // namespace compmark
