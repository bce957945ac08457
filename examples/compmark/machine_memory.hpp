// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The memory that this process may still take. The tool asks the system and tells the library, which never asks.
#pragma once

#include <filesystem>

namespace tool {

/// Bytes: the least of what the machine has available, what its control groups (versions 1 and 2, with all that are
/// above) leave, and what the address space of the process may still grow by. 0: the system does not say. Below `root`
/// are proc and sys/fs/cgroup, as tests lay them out.
[[nodiscard]] double free_memory_bytes(const std::filesystem::path& root = "/");

/// Largest resident size of this process so far, 10^6 bytes.
[[nodiscard]] double peak_memory_mb();

}  // namespace tool
