// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The step of adaptive quantization, under the name of its folder: see math/adaptive_step.hpp, which the entropy models
// share.
#pragma once

#include "compmark/math/adaptive_step.hpp"  // IWYU pragma: export
