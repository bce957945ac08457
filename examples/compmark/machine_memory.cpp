// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "machine_memory.hpp"

#include <sys/resource.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <string_view>

namespace tool {

namespace {

constexpr double nothing_said = std::numeric_limits<double>::infinity();

/// The number of the line that begins with this word and a blank or a colon, or `nothing_said`.
double number_of(const std::filesystem::path& file, std::string_view word) {
  std::ifstream stream(file);
  std::string line;
  while (std::getline(stream, line)) {
    if (line.size() <= word.size() || line.compare(0, word.size(), word) != 0) continue;
    if (line[word.size()] != ' ' && line[word.size()] != ':') continue;
    double value = 0;
    if (std::istringstream(line.substr(word.size() + 1)) >> value) return value;
  }
  return nothing_said;
}
/// The number that a file is, or `nothing_said` ("max").
double number_in(const std::filesystem::path& file) {
  std::ifstream stream(file);
  double value = 0;
  return stream >> value ? value : nothing_said;
}

/// What a group and those above it leave; pages of files that nobody used lately are given back when they are needed.
double left_in_groups(const std::filesystem::path& mount, std::filesystem::path group, const char* limit_name,
                      const char* used_name) {
  double left = nothing_said;
  while (true) {
    const std::filesystem::path folder = mount / group.relative_path();
    const double limit = number_in(folder / limit_name), used = number_in(folder / used_name),
                 files = number_of(folder / "memory.stat", "inactive_file");
    // A limit of version 1 that is none is a number near 2^63.
    if (limit < 0x1p60 && used < nothing_said)
      left = std::min(left, std::max(0.0, limit - used + (files < nothing_said ? files : 0)));
    if (!group.has_relative_path()) return left;
    group = group.parent_path();
  }
}

double left_by_groups(const std::filesystem::path& root) {
  std::ifstream stream(root / "proc/self/cgroup");
  const std::filesystem::path mount = root / "sys/fs/cgroup";
  double left = nothing_said;
  std::string line;
  while (std::getline(stream, line)) {  // number:controllers:path
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::filesystem::path group = line.substr(second + 1);
    if (controllers == ",,") left = std::min(left, left_in_groups(mount, group, "memory.max", "memory.current"));
    if (controllers.find(",memory,") != std::string::npos)
      left = std::min(left, left_in_groups(mount / "memory", group, "memory.limit_in_bytes", "memory.usage_in_bytes"));
  }
  return left;
}

double left_of_address_space(const std::filesystem::path& root) {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return nothing_said;
  const double used = 1024 * number_of(root / "proc/self/status", "VmSize");
  return used < nothing_said ? std::max(0.0, static_cast<double>(limit.rlim_cur) - used) : nothing_said;
}

/// Bytes: the largest resident size since the mark was set back, if it ever was.
double highest_mark(const std::filesystem::path& root) {
  const double mark = 1024 * number_of(root / "proc/self/status", "VmHWM");
  if (mark < nothing_said) return mark;
  rusage usage{};
  if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
#if defined(__APPLE__)
  return static_cast<double>(usage.ru_maxrss);
#else
  return static_cast<double>(usage.ru_maxrss) * 1024;
#endif
}

}  // namespace

double free_memory_bytes(const std::filesystem::path& root) {
  const double left = std::min(
      {1024 * number_of(root / "proc/meminfo", "MemAvailable"), left_by_groups(root), left_of_address_space(root)});
  return left < nothing_said ? std::max(left, 1.0) : 0;  // 0 would be no limit
}

PeakMemory PeakMemory::from_now(const std::filesystem::path& root) {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
  std::ofstream(root / "proc/self/clear_refs") << "5";
  PeakMemory peak;
  peak.root_ = root;
  // Whether it was: a file that takes the word and does nothing is known to exist.
  constexpr double slack = 16e6;  // the system counts pages of threads later than they are taken
  const double mark = highest_mark(root), resident = 1024 * number_of(root / "proc/self/status", "VmRSS");
  peak.before_ = mark <= resident + slack && resident < nothing_said ? 0 : mark;
  return peak;
}

std::optional<double> PeakMemory::mb() const {
  const double mark = highest_mark(root_);
  return mark > before_ ? std::optional<double>(mark / 1e6) : std::nullopt;
}

}  // namespace tool
