// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Projected gradient descent on a picture through a decoder that the thief knows (Madry et al., ICLR 2018): steps by
// the sign of the gradient of the message's cross entropy, held within epsilon of the picture in every value and within
// [0, 1]. The paper has epsilon .1 and says nothing of steps, start and aim (docs/spec/watermark.md, 5); the defaults
// are the usual ones. Without the key's carriers a thief has only a decoder of another key: then pass that one.
// Laws (tests/watermark/attack): T1, T2; T4 no value moves by more than epsilon, and epsilon 0 changes nothing; T5 the
// loss of the message aimed at falls. Cost: a forward and a backward pass of the decoder a step.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/loss/message.hpp"

namespace compmark {

struct PgdSettings {
  double epsilon = 0.1;  ///< largest change of a value, of colours in [0, 1]
  double step = 0.25;    ///< of epsilon
  int steps = 10;        ///< at least 1
  bool random_start = true;
  std::uint64_t seed = 0;
};

/// The bits that a decoder reads in a picture, each the other way round: what an attack without a target aims at.
template <MessageDecoder D, Executor E>
[[nodiscard]] std::vector<std::uint8_t> opposite_bits(ImageView<const float> image, const D& decoder,
                                                      typename D::Context& context, E& executor) {
  std::vector<float> logits(static_cast<std::size_t>(decoder.bits()));
  decoder.forward(image, std::span<float>(logits), context, executor);
  std::vector<std::uint8_t> bits;
  for (const float logit : logits) bits.push_back(logit > 0 ? 0 : 1);
  return bits;
}

/// `aim` [bits] is the message that the picture is to say. The picture has at least decoder.minimum_size() a side.
template <MessageDecoder D, Executor E>
[[nodiscard]] AttackedPicture pgd_picture(ImageView<const float> image, const D& decoder, typename D::Context& context,
                                          std::span<const std::uint8_t> aim, const PgdSettings& settings, E& executor) {
  AttackedPicture result{image.height, image.width, {image.data, image.data + image.size()}};
  if (!(settings.epsilon > 0)) return result;
  for (float& value : result.planes) value = std::clamp(value, 0.0f, 1.0f);  // a render may be beyond, a file is not
  const std::vector<float> before = result.planes;
  const auto epsilon = static_cast<float>(settings.epsilon);
  const auto hold = [&](std::size_t i, float value) {
    result.planes[i] = std::clamp(value, std::max(0.0f, before[i] - epsilon), std::min(1.0f, before[i] + epsilon));
  };
  if (settings.random_start) {
    const Random random(settings.seed, 0, random_stage("attack/pgd"));
    for (std::size_t i = 0; i < before.size(); ++i)
      hold(i, before[i] + static_cast<float>((2 * random.uniform(i) - 1) * settings.epsilon));
  }
  MessageLoss<float> loss;
  loss.settings.reduction = MessageReduction::sum;
  if constexpr (requires { decoder.logit_scale(); })
    loss.settings.logit_scale = static_cast<float>(decoder.logit_scale());
  std::vector<float> logits(aim.size()), d_logits(aim.size()), d_image(before.size());
  const auto step = static_cast<float>(settings.step * settings.epsilon);
  for (int s = 0; s < settings.steps; ++s) {
    decoder.forward(result.view(), std::span<float>(logits), context, executor);
    std::fill(d_logits.begin(), d_logits.end(), 0.0f);
    std::fill(d_image.begin(), d_image.end(), 0.0f);
    loss.forward_backward(logits, aim, 1.0f, d_logits);
    decoder.backward(std::span<const float>(d_logits), ImageView<float>{d_image.data(), 3, image.height, image.width},
                     context, executor);
    for (std::size_t i = 0; i < before.size(); ++i) {
      const float sign = d_image[i] > 0 ? 1.0f : d_image[i] < 0 ? -1.0f : 0.0f;
      hold(i, result.planes[i] - step * sign);
    }
  }
  return result;
}

}  // namespace compmark
