// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a watermark adds to the loss of a render: the message read from it (MessageDecoder -> cross entropy), and the two losses that hold its
// quality, of saturated colours and of frequencies (method sheet, 5.4 - 5.7). Each is a policy of the recipe, absent by default; a weight of
// zero skips the call. Cost: that of the stages; the decoder's forward and backward pass is by far the largest.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/absent.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/loss/concept.hpp"
#include "compmark/loss/message.hpp"
#include "compmark/mark/concept.hpp"

namespace compmark {

/// Weights of one iteration; see MarkPhases.
struct MarkWeights {
  double message = 0;
  double hsv = 0;
  double frequency = 0;
  double image = 1;  ///< of the losses that every recipe has
};

struct MarkReport {
  double message = 0;    ///< mean loss of a bit, cross entropy or hinge
  std::size_t bits = 0;  ///< 0: the message was not read in this iteration
  std::size_t matches = 0;
  double hsv = 0;
  double frequency = 0;
  double departure = 0;  ///< mean square difference from the host's render, where that was measured
  double total = 0;      ///< weighted sum
};

template <class T, class Decoder, class Hsv, class Frequency>
class MarkLosses {
 public:
  static constexpr bool is_absent = !present<Decoder> && !present<Hsv> && !present<Frequency>;

  struct Context {
    MarkWeights weights;  ///< of this iteration
    MarkReport report;    ///< of the last loss
    Buffer<T> logits, d_logits;
    Buffer<double> square;  ///< of the departure from the host's render, a sum for every chunk
    [[no_unique_address]] typename Decoder::Context decoder;
    [[no_unique_address]] typename Hsv::Context hsv;
    [[no_unique_address]] typename Frequency::Context frequency;
  };

  [[no_unique_address]] Decoder decoder;
  [[no_unique_address]] Hsv hsv;
  [[no_unique_address]] Frequency frequency;
  std::vector<std::uint8_t> message;  ///< the bits that a render shall carry, one a byte
  MessageLoss<T> message_loss;

  /// ADDS the gradient of the weighted sum into d_image.
  template <Executor E>
  MarkReport forward_backward(ImageView<const T> image, ImageView<const T> target, ImageView<T> d_image,
                              Context& context, E& executor) const {
    MarkReport report;
    const MarkWeights& weights = context.weights;
    if constexpr (present<Decoder>) {
      if (weights.message != 0 && !message.empty()) {
        const std::span<const T> logits = read(image, context, executor);
        COMPMARK_ASSERT(logits.size() == message.size(), "MarkLosses: the message has not the decoder's length");
        context.d_logits.resize(logits.size());
        std::fill(context.d_logits.begin(), context.d_logits.end(), T(0));
        const MessageReport found =
            message_loss.forward_backward(logits, message, static_cast<T>(weights.message), context.d_logits.span());
        decoder.backward(std::span<const T>(context.d_logits.data(), logits.size()), d_image, context.decoder,
                         executor);
        report.message = found.loss;
        report.bits = found.bits;
        report.matches = found.matches;
        report.total += weights.message * found.loss;
      }
    }
    if constexpr (present<Hsv>) {
      if (weights.hsv != 0) {
        report.hsv =
            hsv.forward_backward(image, target, static_cast<T>(weights.hsv), d_image, context.hsv, executor).loss;
        report.total += weights.hsv * report.hsv;
      }
    }
    if constexpr (present<Frequency>) {
      if (weights.frequency != 0) {
        report.frequency = frequency
                               .forward_backward(image, target, static_cast<T>(weights.frequency), d_image,
                                                 context.frequency, executor)
                               .loss;
        report.total += weights.frequency * report.frequency;
      }
    }
    return report;
  }

  /// Logits of an image, valid until the next call in this context.
  template <Executor E>
  [[nodiscard]] std::span<const T> read(ImageView<const T> image, Context& context, E& executor) const
      requires(present<Decoder>) {
    const std::size_t bits = static_cast<std::size_t>(decoder.bits());
    context.logits.resize(bits);
    decoder.forward(image, context.logits.span(), context.decoder, executor);
    return {context.logits.data(), bits};
  }
};

}  // namespace compmark
