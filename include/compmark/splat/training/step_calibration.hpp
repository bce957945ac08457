// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a codec does about a message that is hidden in what its context reads: nothing, unless the codec specialises
// StepCalibrationOf for such recipes (codec/model/step_bias_calibration.hpp). So neither wing knows the other. Cost:
// none.
#pragma once

#include "compmark/core/absent.hpp"

namespace compmark {

/// The codec's steps do not hang on what carries the message.
struct NoStepCalibration : Absent<NoStepCalibration> {};

template <class R>
struct StepCalibrationOf {
  using type = NoStepCalibration;
};
/// `calibrate` is called from time to time while a message is embedded; `wanted` is its state in a checkpoint.
template <class R>
using StepCalibration = typename StepCalibrationOf<R>::type;

}  // namespace compmark
