// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Message loss: the cost of the logits z of a MessageDecoder when the bits m are expected, and its gradient
// (docs/spec/method.md, 5.4). With x = scale z and s = +1 for a one, -1 for a zero, it is cross entropy softplus(-s x),
// with derivative -s scale sigmoid(-s x); or a hinge max(0, margin - s x) (Fernandez et al., ICASSP 2022); or a power
// of it, margin (max(0, margin - s x) / margin)^power, whose gradient grows with the error of a bit. Both are written
// in the sign that does not cancel: a bit that is safely right keeps its full relative digits, and |x| = 1e4 gives no
// infinity unless the power itself is infinite (docs/spec/numerics.md, LS8). The loss is the mean over the bits as
// released, or their sum as in the paper. Cost: two transcendentals a bit.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/config.hpp"

namespace compmark {

enum class MessageRule {
  cross_entropy,
  hinge,  ///< a bit that is right by `margin` has no gradient
};
enum class MessageReduction {
  mean,
  sum,  ///< the paper's: its weight grows with the number of bits
};

/// What one evaluation found; `loss` is without the caller's weight.
struct MessageReport {
  double loss = 0;
  std::size_t matches = 0;  ///< bits whose sign is right: a logit above 0 reads one, 0 and below zero, NaN nothing
  std::size_t bits = 0;
  double smallest_margin = 0;  ///< the smallest s z, in logits: negative while a bit is wrong; NaN when a logit is
  [[nodiscard]] double accuracy() const {
    return bits == 0 ? 0 : static_cast<double>(matches) / static_cast<double>(bits);
  }
};

template <class T>
class MessageLoss {
 public:
  using Scalar = T;
  struct Settings {
    /// The published decoders give logits of about +-0.1; a scale of 10 brings them into the range where the loss is
    /// not linear (docs/spec/method.md, 7.10). For another decoder choose scale * deviation = 0.5 ... 1.
    T logit_scale = T(10);
    MessageRule rule = MessageRule::cross_entropy;
    MessageReduction reduction = MessageReduction::mean;
    T margin = T(5);  ///< of the hinge, in scaled logits; carriers are published with logit_scale 1 and margin 5
    /// Power of the hinge, at least 1; above 1 it needs a margin above 0. At 1, as published, all bits within the
    /// margin have the same gradient; at 2 the gradient is proportional to the error.
    T power = T(1);
  };

  Settings settings;

  MessageLoss() = default;
  explicit MessageLoss(const Settings& chosen) : settings(chosen) {}

  /// `bits`: 0 is a zero, anything else a one. No bits: loss 0.
  [[nodiscard]] MessageReport forward(std::span<const T> logits, std::span<const std::uint8_t> bits) const {
    return run<false>(logits, bits, T(0), {});
  }
  /// ADDS weight dloss/dz.
  MessageReport forward_backward(std::span<const T> logits, std::span<const std::uint8_t> bits, T weight,
                                 std::span<T> d_logits) const {
    COMPMARK_ASSERT(d_logits.size() == logits.size(), "MessageLoss: gradient and logits differ in size");
    return run<true>(logits, bits, weight, d_logits);
  }

 private:
  template <bool Backward>
  MessageReport run(std::span<const T> logits, std::span<const std::uint8_t> bits, T weight,
                    std::span<T> d_logits) const {
    COMPMARK_ASSERT(logits.size() == bits.size(), "MessageLoss: one logit a bit");
    COMPMARK_ASSERT(settings.rule != MessageRule::hinge || settings.power == T(1) ||
                        (settings.power > T(1) && settings.margin > T(0)),
                    "MessageLoss: a hinge has a power of 1, or one above it and a margin");
    MessageReport report;
    report.bits = bits.size();
    if (bits.empty()) return report;
    const bool mean = settings.reduction == MessageReduction::mean;
    const T slope = weight * settings.logit_scale / (mean ? static_cast<T>(bits.size()) : T(1));
    for (std::size_t i = 0; i < bits.size(); ++i) {
      const bool one = bits[i] != 0;
      const T sign = one ? T(1) : T(-1);
      const T right = sign * settings.logit_scale * logits[i];  // how far on the right side
      T loss, pull;                                             // pull = -dloss/dright >= 0
      if (settings.rule == MessageRule::cross_entropy) {
        const T e = std::exp(-std::abs(right));
        loss = (right < T(0) ? -right : T(0)) + std::log1p(e);
        pull = (right < T(0) ? T(1) : e) / (T(1) + e);
      } else {
        const T missing = settings.margin - right;
        if (missing <= T(0)) {
          loss = pull = T(0);
        } else {
          // Power 1 needs no margin to divide by. NaN is missing too.
          const T steep = settings.power == T(1) ? T(1) : std::pow(missing / settings.margin, settings.power - T(1));
          loss = missing * steep;
          pull = settings.power * steep;
        }
      }
      report.loss += static_cast<double>(loss);
      const double margin = static_cast<double>(sign * logits[i]);
      if (i == 0 || margin < report.smallest_margin || std::isnan(margin)) report.smallest_margin = margin;
      report.matches += (one ? logits[i] > T(0) : logits[i] <= T(0)) ? 1 : 0;
      if constexpr (Backward) d_logits[i] -= sign * slope * pull;
    }
    if (mean) report.loss /= static_cast<double>(bits.size());
    return report;
  }
};

}  // namespace compmark
