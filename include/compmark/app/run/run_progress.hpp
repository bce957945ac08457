// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a run tells of an iteration.
#pragma once

#include <cstdint>
#include <optional>

namespace compmark {

/// One finished iteration. Optional values are those that not every iteration has.
struct RunProgress {
  std::int64_t iteration = 0;  ///< 1-based
  std::int64_t total = 0;
  double loss = 0;
  double l1 = 0;
  double ssim = 0;
  double psnr = 0;  ///< of the training view rendered last, dB; measured in every tenth iteration
  std::uint64_t anchors = 0;
  std::uint64_t gaussians = 0;            ///< of this view
  std::uint64_t revivals = 0;             ///< so often the opacities of a training that had died were set anew
  std::optional<double> bits_per_scalar;  ///< of what would be stored, where the rate is a loss
  std::optional<double> bit_accuracy;     ///< of the training view, where a message was read from it
};

}  // namespace compmark
