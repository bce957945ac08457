// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The phase of an entropy model in an iteration of training, and its report. The codecs share both, so that one
// schedule drives them all (docs/spec/compression.md, 1.6). Cost: none.
#pragma once

#include <cstddef>
#include <cstdint>

namespace compmark {

/// The work of the model in one iteration. All false: none.
struct RatePhase {
  bool noise = false;    ///< noise of the base steps
  bool context = false;  ///< noise of the predicted steps …
  bool round = false;    ///< … or rounding by them
  bool counts = true;    ///< with context: the rate is a loss
  std::uint64_t seed = 0, iteration = 0;

  [[nodiscard]] constexpr bool active() const { return noise || context; }
};

struct RateReport {
  double loss = 0;
  double bits_per_scalar = 0;                                  ///< of the sample; masked ones count as 0 bits
  double bits_feature = 0, bits_scaling = 0, bits_offset = 0;  ///< the same by group
  double hash_bits = 0;                                        ///< of the whole grid
  double unmasked_share = 0;                                   ///< of the sample's anchors; HAC: of all candidates
  double step_feature = 0, step_scaling = 0, step_offset = 0;  ///< mean over visible anchors
  double unmasked_offsets = 0;                                 ///< of the sample's offsets
  std::size_t sampled = 0;                                     ///< anchors
};

}  // namespace compmark
