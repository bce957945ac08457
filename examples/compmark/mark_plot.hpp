// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What was read of a message, as a picture for the pages.
#pragma once

#include <compmark/watermark/proof/message.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <string>

#include "report.hpp"

namespace tool {

/// The fused logits, a dot a bit: above 0 those that are right.
Plot logit_plot(const compmark::Message& message, const compmark::Verification& verification, const std::string& title);

}  // namespace tool
