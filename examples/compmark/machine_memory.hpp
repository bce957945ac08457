// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The memory that this process may still take. The tool asks the system and tells the library, which never asks.
#pragma once

#include <filesystem>
#include <optional>

namespace tool {

/// Bytes: the least of what the machine has available, what its control groups (versions 1 and 2, with all that are
/// above) leave, and what the address space of the process may still grow by. 0: the system does not say. Below `root`
/// are proc and sys/fs/cgroup, as tests lay them out.
[[nodiscard]] double free_memory_bytes(const std::filesystem::path& root = "/");

/// The largest resident size of a part of this process's life, 10^6 bytes.
class PeakMemory {
 public:
  /// Of the whole life.
  PeakMemory() = default;
  /// From now on. Memory that was freed goes back to the system first, and the system's own mark is set back where it
  /// can be (Linux: proc/self/clear_refs, below `root`). One at a time: the mark is the process's.
  [[nodiscard]] static PeakMemory from_now(const std::filesystem::path& root = "/");
  /// Nothing: it is not known, since the mark could not be set back and an earlier part took as much or more.
  [[nodiscard]] std::optional<double> mb() const;

 private:
  std::filesystem::path root_ = "/";
  double before_ = 0;  ///< bytes, where only a larger mark is of this part
};

}  // namespace tool
