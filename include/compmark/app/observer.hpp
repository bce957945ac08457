// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What functions of app tell while they work: how much of it is done. It is for a line of progress and for stopping;
// nothing of what comes out depends on it.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "compmark/core/result.hpp"

namespace compmark {

/// After every unit of work; false stops, and the function returns ErrorKind::cancelled. May be empty. Called on the
/// caller's thread.
using WorkObserver = std::function<bool(std::size_t done, std::size_t total)>;

/// Called with a plain sentence: what is not used, what cannot be kept, what was done besides. May be empty.
using SentenceSink = std::function<void(const std::string& sentence)>;

namespace detail {

[[nodiscard]] inline Error stopped() { return {ErrorKind::cancelled, {}, {}, "was stopped by its observer", {}}; }
[[nodiscard]] inline Result<Done> tell(const WorkObserver& observer, std::size_t done, std::size_t total) {
  if (!observer || observer(done, total)) return Done{};
  return stopped();
}

}  // namespace detail
}  // namespace compmark
