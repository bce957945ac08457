// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The watermark's interface to a loop: setting the message, and reports of the last iteration's readings and losses.
// Cost: none.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/novel_view_reading.hpp"
#include "compmark/watermark/embed/stages/frequency.hpp"
#include "compmark/watermark/embed/stages/hsv.hpp"
#include "compmark/watermark/embed/stages/message.hpp"
#include "compmark/watermark/proof/message.hpp"

namespace compmark {

/// The readings of the message in one iteration, and the losses beside them.
struct MarkReport : ReadingReport {
  double hsv = 0;
  double frequency = 0;
};

/// Tells a loop whose recipe has a MessageDecoder, Trainer or PosthocEmbedding, the decoder and the bits that every
/// render shall carry: bit i is 0 or 1, one for each bit of the decoder. Before the first step.
template <class Loop, class Decoder = typename Loop::RecipeType::MessageDecoder>
void set_watermark(Loop& loop, Decoder decoder, std::span<const std::uint8_t> message) {
  loop.template stage<MessageStage>().set(std::move(decoder), message, loop.settings().mark);
}
template <class Loop, class Decoder = typename Loop::RecipeType::MessageDecoder>
void set_watermark(Loop& loop, Decoder decoder, const Message& message) {
  std::vector<std::uint8_t> bits(message.size());
  for (std::size_t i = 0; i < bits.size(); ++i) bits[i] = message[i] ? 1 : 0;
  set_watermark(loop, std::move(decoder), bits);
}

/// Of the stages of a context after Pipeline::loss.
template <class Context>
[[nodiscard]] MarkReport mark_report_of(const Context& context) {
  MarkReport report;
  using Stages = typename Context::Stages;
  if constexpr (has_stage<Stages, MessageStage>) {
    const auto& message = context.template of<MessageStage>().report;
    report.message = message.loss;
    report.bits = message.bits;
    report.matches = message.matches;
    report.total += context.phases.template of<MessageStage>().weight * message.loss;
  }
  if constexpr (has_stage<Stages, HsvStage>) {
    report.hsv = context.template of<HsvStage>().loss;
    report.total += context.phases.template of<HsvStage>().weight * report.hsv;
  }
  if constexpr (has_stage<Stages, FrequencyStage>) {
    report.frequency = context.template of<FrequencyStage>().loss;
    report.total += context.phases.template of<FrequencyStage>().weight * report.frequency;
  }
  return report;
}

/// Losses and readings of the watermark in the last iteration of a loop.
template <class Loop>
[[nodiscard]] MarkReport mark_report(const Loop& loop) {
  if constexpr (requires { loop.reading(); }) {
    return {loop.reading().report(), 0, 0};
  } else {
    return mark_report_of(loop.context());
  }
}
/// The reading of a training in the last sampled novel view.
template <class Loop>
[[nodiscard]] const ReadingReport& novel_view_report(const Loop& trainer) {
  return trainer.template training_state<MessageStage>().report();
}

}  // namespace compmark
