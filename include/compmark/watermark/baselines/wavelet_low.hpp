// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The low band of a level of the wavelet "bior4.4" (wavelet_band.hpp): what WateRF (Jang et al., CVPR 2024) reads a
// message from, at two levels. Cost: that of a band.
#pragma once

#include "compmark/watermark/baselines/wavelet_band.hpp"

namespace compmark {

template <class T>
class WaveletLow : public WaveletBand<T> {
 public:
  WaveletLow() : WaveletBand<T>(WaveletPass::low, WaveletPass::low) {}
};

}  // namespace compmark
