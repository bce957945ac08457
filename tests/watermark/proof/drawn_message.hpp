// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A random message of a test's own stream.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compmark/core/random.hpp"
#include "compmark/watermark/proof/message.hpp"

namespace compmark::testing {

[[nodiscard]] inline Message drawn_message(const Random& stream, std::uint64_t index, std::size_t bits) {
  return Message::from_words(stream.bits(2 * index), stream.bits(2 * index + 1), bits);
}

}  // namespace compmark::testing
