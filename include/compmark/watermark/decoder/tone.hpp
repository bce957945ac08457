// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The light of an image: every channel times a gain, plus an offset. Each photograph of a capture has its own
// (exposure, white balance), an editor adds another, and a shiny surface has a different one from every side. A decoder
// fitted to renders of one unmarked model has only seen one light; without augmentation, a change of 2 % moves its
// logits more than a message does (docs/notebook/watermark_experiments.md). Cost: a multiplication, an addition and two
// comparisons a value.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "compmark/core/config.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

template <class T>
struct Tone {
  std::array<T, 3> gain{T(1), T(1), T(1)};
  std::array<T, 3> offset{T(0), T(0), T(0)};
};

/// Gains of 1 +- `deviation` and offsets of half of it, normal; half of each one's variance is common to the channels:
/// exposures and white balances. Uses the indices first ... first + 7 of the stream.
template <class T>
[[nodiscard]] Tone<T> drawn_tone(double deviation, const Random& random, std::uint64_t first = 0) {
  const double share = deviation / std::numbers::sqrt2;
  const double all_gain = random.normal(first), all_offset = random.normal(first + 1);
  Tone<T> tone;
  for (std::uint64_t c = 0; c < 3; ++c) {
    tone.gain[c] = static_cast<T>(1 + share * (all_gain + random.normal(first + 2 + 2 * c)));
    tone.offset[c] = static_cast<T>(0.5 * share * (all_offset + random.normal(first + 3 + 2 * c)));
  }
  return tone;
}

/// `image` in that light, from 0 to 1; both may be the same memory.
template <class T>
void apply_tone(const Tone<T>& tone, ImageView<const T> image, ImageView<T> toned) {
  COMPMARK_ASSERT(image.channels == 3 && toned.channels == 3 && toned.size() == image.size(),
                  "apply_tone: RGB images of one size");
  const std::size_t plane = image.size() / 3;
  for (std::size_t c = 0; c < 3; ++c) {
    const T gain = tone.gain[c], offset = tone.offset[c];
    const T* const from = image.data + c * plane;
    T* const to = toned.data + c * plane;
    for (std::size_t i = 0; i < plane; ++i) to[i] = std::clamp(gain * from[i] + offset, T(0), T(1));
  }
}

}  // namespace compmark
