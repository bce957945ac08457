// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of a MessageDecoder (watermark/decoder/concept.hpp): reads the message from the render and adds the loss of
// its bits. In a training it also reads sampled novel views, where MessageSettings::novel_view_every says so. Cost: the
// decoder's forward and backward pass, and for a sampled view a render and its backward pass more.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/mark_phases.hpp"
#include "compmark/watermark/embed/novel_view_reading.hpp"
#include "compmark/watermark/loss/message.hpp"

namespace compmark {

template <class Decoder>
class MessageStage : public Stage<MessageStage<Decoder>> {
 public:
  using Scalar = typename Decoder::Scalar;
  using Own = StageOfLoss<MessageStage>;
  struct Phase {
    double weight = 0;         ///< of the loss of the bits; 0: the message is not read
    StageIteration iteration;  ///< whose edits a decoder draws that has some (watermark/edit/edit_chain.hpp)
  };
  struct Context {
    MessageReport report;  ///< of the last loss; no bits: it was not read
    Buffer<Scalar> logits, d_logits;
    Buffer<double> distortion;  ///< scratch of message_loss (novel_view_reading.hpp), a sum for every chunk
    typename Decoder::Context decoder;
  };
  /// Of views between the photographed ones.
  template <class R>
  using TrainingState = NovelViewReading<R>;

  [[no_unique_address]] Decoder decoder;
  std::vector<std::uint8_t> message;  ///< the bits that a render shall carry, one a byte
  MessageLoss<Scalar> message_loss;

  /// Sets the decoder and the message of every render: bit i of `bits` is 0 or 1, one for each bit of the decoder.
  void set(Decoder reader, std::span<const std::uint8_t> bits, const MarkNumbers& mark) {
    COMPMARK_ASSERT(static_cast<std::size_t>(reader.bits()) == bits.size(), "MessageStage: message length");
    auto& loss = message_loss.settings;
    loss.logit_scale = static_cast<Scalar>(mark.message.logit_scale);
    loss.reduction = mark.message.sum ? MessageReduction::sum : MessageReduction::mean;
    if (mark.message.hinge_margin > 0) {
      loss.rule = MessageRule::hinge;
      loss.margin = static_cast<Scalar>(mark.message.hinge_margin);
      loss.power = static_cast<Scalar>(mark.message.hinge_power);
    }
    decoder = std::move(reader);
    message.assign(bits.begin(), bits.end());
  }

  template <class R>
  void configure(const TrainSettings& settings) {
    phases_ = MarkPhases(settings.mark, settings.iterations);
  }
  void set_phase(const StageIteration& iteration, Phase& phase) const {
    phase.weight = phases_.weights(iteration.t).message;
    phase.iteration = iteration;
  }
  void weigh_losses(const StageIteration& iteration, double& image_weight) const {
    COMPMARK_ASSERT(!phases_.held(),
                    "Trainer: a mark that is held to a finished model's renders is learned by PosthocEmbedding");
    image_weight = phases_.weights(iteration.t).image;
  }
  template <class Training, class State>
  void after_backward(const Training& training, State& state) const {
    if (training.adjusted || !phases_.reads_between(training.t)) return;
    const auto report = state.read(training.pipeline, training.model, training.views, training.view, training.seed,
                                   training.t, phases_, training.phases, training.executor);
    if (report.raster.error) training.error = report.raster.error;
  }

  template <class Pass, class Report>
  void loss(const Pass& pass, const Own& own, Report& report) const {
    own.context.report = pull(pass.context.image, pass.context.d_image, own.phase, own.context, pass.executor);
    report.total += own.phase.weight * own.context.report.loss;
  }
  /// Reads the message, of the edited image where the decoder has edits, and ADDS the phase's weight times the gradient
  /// of its loss into d_image. A weight of 0 reads nothing.
  template <class E>
  MessageReport pull(ImageView<const Scalar> image, ImageView<Scalar> d_image, const Phase& phase, Context& context,
                     E& executor) const {
    if (phase.weight == 0 || message.empty()) return {};
    if constexpr (has_edits) {
      const Random random(phase.iteration.seed, static_cast<std::uint64_t>(phase.iteration.t),
                          random_stage("message edits"));
      decoder.draw_edits(context.decoder, &random);
    }
    const std::span<const Scalar> logits = logits_of(image, context, executor);
    COMPMARK_ASSERT(logits.size() == message.size(), "MessageStage: the message has not the decoder's length");
    context.d_logits.resize(logits.size());
    std::fill(context.d_logits.begin(), context.d_logits.end(), Scalar(0));
    const MessageReport report =
        message_loss.forward_backward(logits, message, static_cast<Scalar>(phase.weight), context.d_logits.span());
    decoder.backward(std::span<const Scalar>(context.d_logits.data(), logits.size()), d_image, context.decoder,
                     executor);
    return report;
  }
  /// Logits of an image, valid until the next call in this context.
  template <class E>
  [[nodiscard]] std::span<const Scalar> read(ImageView<const Scalar> image, Context& context, E& executor) const {
    if constexpr (has_edits) decoder.draw_edits(context.decoder, nullptr);
    return logits_of(image, context, executor);
  }

 private:
  static constexpr bool has_edits =
      requires(const Decoder& edited, typename Decoder::Context& own, const Random& random) {
    edited.draw_edits(own, &random);
  };

  template <class E>
  [[nodiscard]] std::span<const Scalar> logits_of(ImageView<const Scalar> image, Context& context, E& executor) const {
    const auto bits = static_cast<std::size_t>(decoder.bits());
    context.logits.resize(bits);
    decoder.forward(image, context.logits.span(), context.decoder, executor);
    return {context.logits.data(), bits};
  }

  MarkPhases phases_;
};

}  // namespace compmark
