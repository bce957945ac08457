// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A new owner's key with the date of today (compmark/app/run/owner_keys.hpp).
#pragma once

#include <compmark/app/run/owner_keys.hpp>
#include <compmark/core/result.hpp>
#include <string>

namespace tool {

/// make_key_file with this machine's clock. Returns what is said about the key; warnings go to stderr.
[[nodiscard]] compmark::Result<std::string> make_dated_key(compmark::KeySettings settings);

}  // namespace tool
