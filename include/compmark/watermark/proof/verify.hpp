// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Is this message in these images? Null hypothesis: the key was drawn at random and independently of the images. Then
// the number of matching bits is Binomial(n, 1/2) exactly, whatever the decoder's bias and correlations, because the
// randomness is in the key (docs/spec/watermark.md, 5). Views of one scene are not independent, so their p-values are
// never multiplied: logits are fused without looking at the key, then one test of n bits decides. Trying many keys or
// crops multiplies the error (Bonferroni). Cost: O(views * bits).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/binomial.hpp"
#include "compmark/watermark/proof/message.hpp"
#include "compmark/watermark/proof/recipient_trace.hpp"

namespace compmark {

/// How logits of several views become one logit a bit. None of them looks at the key.
enum class FusionRule : std::uint8_t {
  scaled,    ///< sum of z_v / rms(z_v): every view has the same weight, its bits keep their relative certainty
  tanh,      ///< sum of tanh(z_v / rms(z_v)): a single outlier cannot decide a bit
  majority,  ///< sum of signs, for comparison with published work
};

enum class Verdict : std::uint8_t {
  detected,      ///< tries * p <= false_positive_rate
  not_detected,  ///< no evidence: tries * p > suspicion. It does not prove that there is no mark
  inconclusive,  ///< in between, or no number of matches could reach the rate with these bits and tries, and no spread
                 ///< mark that was looked for too
};

struct VerifySettings {
  double false_positive_rate = 1e-6;  ///< of the whole procedure, chosen before the test
  double suspicion = 1e-2;            ///< corrected p-values up to this are not called "not detected"
  std::uint64_t tries = 1;  ///< keys times alignments (crops, scales, selections of views) that were or will be tried
  FusionRule fusion = FusionRule::scaled;
  double recipient_rate = 1e-3;  ///< of naming a recipient who had no part, where a key has recipients
};

/// What a decoder read from one image.
struct ViewLogits {
  std::string name;
  std::string sha256;  ///< of the image file; may be empty
  std::vector<double> logits;
  std::optional<PictureBox> part = {};  ///< of the image, in pixels: what was read of a page (page_box.hpp)
};

/// Evidence of one reading.
struct Evidence {
  std::size_t matches = 0;
  double p_value = 1;  ///< probability that a random key matches at least so well, before any correction
};

struct Verification {
  std::size_t bits = 0;
  std::vector<Evidence> views;           ///< one by one, for information: they do not enter the verdict
  std::vector<double> fused;             ///< one logit a bit
  Message read;                          ///< signs of `fused`
  Evidence evidence;                     ///< of the fused logits
  double p_corrected = 1;                ///< min(1, tries * p)
  std::optional<std::size_t> threshold;  ///< matches needed at this rate and number of tries; empty: impossible
  Verdict verdict = Verdict::not_detected;
  VerifySettings settings;
  std::optional<RecipientTrace> recipients{};  ///< of a key that has some (recipients.hpp)
  bool spread_could_decide = false;  ///< a spread mark was looked for too, in cells that say enough to reach the rate
};

/// Smallest number of matches of `bits` whose p-value is at most `rate`; empty if even all bits are not enough.
[[nodiscard]] inline std::optional<std::size_t> match_threshold(std::size_t bits, double rate) {
  std::optional<std::size_t> result;
  for (std::size_t k = bits; k + 1 > 0 && binomial_tail(k, bits) <= rate; --k) result = k;
  return result;
}

/// The rate that one test of `tries` must keep so that all together keep `rate`.
[[nodiscard]] inline double rate_per_try(double rate, std::uint64_t tries) {
  return rate / static_cast<double>(tries < 1 ? 1 : tries);
}

/// Probability to detect a mark whose bits are read right independently with probability `accuracy`.
[[nodiscard]] inline double detection_power(std::size_t bits, double accuracy, double rate, std::uint64_t tries = 1) {
  const std::optional<std::size_t> threshold = match_threshold(bits, rate_per_try(rate, tries));
  return threshold ? binomial_tail(*threshold, bits, accuracy) : 0;
}

/// Bit accuracy expected after soft fusion of `views` views of bit accuracy `accuracy` each, whose errors correlate by
/// `correlation`: Phi(Phi^-1(a) sqrt(V / (1 + (V - 1) rho))), for 1/2 <= a < 1.
[[nodiscard]] inline double fused_accuracy(double accuracy, std::size_t views, double correlation) {
  COMPMARK_ASSERT(accuracy >= 0.5 && accuracy < 1 && views > 0, "fused_accuracy: 1/2 <= accuracy < 1");
  const auto normal_cdf = [](double x) { return 0.5 * std::erfc(-x * 0.70710678118654752440); };
  double low = 0, high = 9;
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (low + high);
    (normal_cdf(middle) < accuracy ? low : high) = middle;
  }
  const double count = static_cast<double>(views);
  return normal_cdf(low * std::sqrt(count / (1 + (count - 1) * correlation)));
}

/// Fuses logits of views, in the order of the views; all have `fused.size()` logits, finite. A view of zeros has no
/// weight.
inline void fuse_logits(std::span<const ViewLogits> views, FusionRule rule, std::span<double> fused) {
  for (double& value : fused) value = 0;
  for (const ViewLogits& view : views) {
    COMPMARK_ASSERT(view.logits.size() == fused.size(), "fuse_logits: one logit a bit");
    double largest = 0, energy = 0;  // scaled by the largest, so that no square overflows
    for (const double z : view.logits) largest = std::fmax(largest, std::abs(z));
    if (!(largest > 0)) continue;
    for (const double z : view.logits) energy += (z / largest) * (z / largest);
    const double rms = std::sqrt(energy / static_cast<double>(fused.size()));
    for (std::size_t i = 0; i < fused.size(); ++i) {
      const double z = view.logits[i] / largest / rms;
      fused[i] += rule == FusionRule::scaled ? z
                  : rule == FusionRule::tanh ? std::tanh(z)
                  : view.logits[i] > 0       ? 1
                                             : -1;
    }
  }
}

[[nodiscard]] inline Evidence evidence_of(const Message& expected, std::span<const double> logits) {
  const std::size_t count = matches(expected, logits);
  return {count, binomial_tail(count, expected.size())};
}

/// So that counting them twice never wraps.
inline constexpr std::uint64_t largest_tries = std::uint64_t{1} << 62;

/// One line where the settings are no test. `tests` are made of each try: both ways of a picture, or message and spread
/// mark.
[[nodiscard]] inline Result<Done> check_settings(const VerifySettings& settings, std::uint64_t tests = 1) {
  if (!(settings.false_positive_rate > 0 && settings.false_positive_rate < 1)) {
    return Error{ErrorKind::invalid, "", "false positive rate", "is not between 0 and 1",
                 "give the rate of false accusations you accept, as 1e-6"};
  }
  if (!(settings.suspicion >= 0 && settings.suspicion <= 1)) {
    return Error{ErrorKind::invalid, "", "suspicion", "is not between 0 and 1",
                 "give the p-value up to which a result is called inconclusive, as 1e-2"};
  }
  if (!(settings.recipient_rate > 0 && settings.recipient_rate < 1)) {
    return Error{ErrorKind::invalid, "", "recipient rate", "is not between 0 and 1",
                 "give the rate of naming somebody who had no part, as 1e-3"};
  }
  if (settings.tries < 1)
    return Error{ErrorKind::invalid, "", "tries", "is 0", "count every key and alignment that is tried"};
  if (settings.tries > largest_tries / tests) {
    return Error{ErrorKind::invalid, "", "tries",
                 "is above " + (tests == 1 ? std::string("2^62")
                                           : std::to_string(largest_tries / tests) + ", and each is " +
                                                 std::to_string(tests) + " tests here"),
                 "no count of tests is that large"};
  }
  return Done{};
}

/// Tests one message against the logits of one or more views.
[[nodiscard]] inline Result<Verification> verify_message(const Message& expected, std::span<const ViewLogits> views,
                                                         const VerifySettings& settings = {}) {
  const auto fail = [](std::string field, std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, "", std::move(field), std::move(problem), std::move(remedy)};
  };
  if (Result<Done> checked = check_settings(settings); !checked) return checked.error();
  if (expected.size() == 0) return fail("message", "is empty", "give a message");
  if (views.empty()) return fail("views", "there is none", "give at least one image");
  for (const ViewLogits& view : views) {
    if (view.logits.size() != expected.size()) {
      return fail(
          view.name,
          std::to_string(view.logits.size()) + " bits were read, the message has " + std::to_string(expected.size()),
          "use the decoder and the key of one message length");
    }
    for (const double z : view.logits) {
      if (!std::isfinite(z))
        return fail(view.name, "a logit is not finite", "check the image and the decoder's weights");
    }
  }
  Verification result;
  result.settings = settings;
  result.bits = expected.size();
  for (const ViewLogits& view : views) result.views.push_back(evidence_of(expected, view.logits));
  result.fused.resize(result.bits);
  fuse_logits(views, settings.fusion, result.fused);
  result.read = Message::from_logits<double>(result.fused);
  result.evidence = evidence_of(expected, result.fused);
  result.p_corrected = std::fmin(1, result.evidence.p_value * static_cast<double>(settings.tries));
  result.threshold = match_threshold(result.bits, rate_per_try(settings.false_positive_rate, settings.tries));
  if (result.threshold && result.evidence.matches >= *result.threshold) {
    result.verdict = Verdict::detected;
  } else if (!result.threshold || result.p_corrected <= settings.suspicion) {
    result.verdict = Verdict::inconclusive;
  }
  return result;
}

}  // namespace compmark
