// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How many processors this process may use, which is not how many the machine has: a scheduler pins it to some (taskset,
// Slurm), a container has a quota of time. More threads than that wait for each other.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#if defined(__linux__)
#include <sched.h>

#include <cerrno>
#include <cstdio>
#endif

namespace compmark {
namespace detail {

inline constexpr std::size_t no_processor_limit = std::numeric_limits<std::size_t>::max();

/// ceil(quota / period) of a control group: one and a half processors' time is best spent by two threads that stand still
/// for a quarter of it. Anything that is no pair of positive numbers ("max", -1) is no limit.
[[nodiscard]] inline std::size_t processors_of_quota(std::string_view quota, std::string_view period) {
  const auto number = [](std::string_view text) {
    std::int64_t value = 0;
    const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
    return read.ec == std::errc{} ? value : std::int64_t{0};
  };
  const std::int64_t time = number(quota);
  const std::int64_t of = number(period);
  if (time <= 0 || of <= 0) return no_processor_limit;
  return static_cast<std::size_t>((time - 1) / of + 1);
}

#if defined(__linux__)
/// The first 64 KiB of a file of the kernel; empty where there is none.
[[nodiscard]] inline std::string kernel_text(const std::string& path) {
  std::string text;
  std::FILE* const file = std::fopen(path.c_str(), "re");
  if (file == nullptr) return text;
  text.resize(std::size_t{1} << 16);
  text.resize(std::fread(text.data(), 1, text.size(), file));
  std::fclose(file);
  return text;
}

/// The least quota of the control groups that this process is in, from its own up to the root: version 2 (one line
/// "quota period" in cpu.max) and version 1 (two files of the controller cpu). `proc` is the text of /proc/self/cgroup,
/// with lines "id:controllers:path"; `root` is where the groups are mounted.
[[nodiscard]] inline std::size_t processors_of_groups(std::string_view proc, const std::string& root) {
  const auto limit_of = [](const std::string& folder) {
    const std::string both = kernel_text(folder + "/cpu.max");
    const std::size_t space = both.find(' ');
    if (space != std::string::npos)
      return processors_of_quota(std::string_view(both).substr(0, space), std::string_view(both).substr(space + 1));
    return processors_of_quota(kernel_text(folder + "/cpu.cfs_quota_us"), kernel_text(folder + "/cpu.cfs_period_us"));
  };
  std::size_t least = no_processor_limit;
  while (!proc.empty()) {
    const std::string_view line = proc.substr(0, proc.find('\n'));
    proc.remove_prefix(std::min(line.size() + 1, proc.size()));
    const std::size_t first = line.find(':');
    const std::size_t second = first == std::string_view::npos ? first : line.find(':', first + 1);
    if (second == std::string_view::npos) continue;
    const std::string_view controllers = line.substr(first + 1, second - first - 1);
    // Version 2 names none; in version 1 the folder has the controllers' names, "cpu,cpuacct", or a link called "cpu".
    const bool version_2 = controllers.empty();
    if (!version_2 && ("," + std::string(controllers) + ",").find(",cpu,") == std::string::npos) continue;
    const std::string mounted = version_2 ? root : root + "/cpu";
    for (std::string path(line.substr(second + 1));; path.resize(path.rfind('/'))) {
      while (!path.empty() && path.back() == '/') path.pop_back();
      least = std::min(least, limit_of(mounted + path));
      if (path.empty() || path.find('/') == std::string::npos) break;
    }
  }
  return least;
}

/// The processors that this process may run on. The system says EINVAL while a set has no room for as many as the
/// machine could have: a set of the usual 1,024 has none on the largest, and is tried again twice as large.
[[nodiscard]] inline std::size_t processors_of_affinity(std::size_t room = 1024) {
  for (constexpr std::size_t most = std::size_t{1} << 20; room <= most; room = std::max<std::size_t>(64, 2 * room)) {
    std::vector<cpu_set_t> set((room + CPU_SETSIZE - 1) / CPU_SETSIZE);
    const std::size_t bytes = set.size() * sizeof(cpu_set_t);
    if (::sched_getaffinity(0, bytes, set.data()) == 0) return static_cast<std::size_t>(CPU_COUNT_S(bytes, set.data()));
    if (errno != EINVAL) break;
  }
  return no_processor_limit;
}
#endif

}  // namespace detail

/// The machine's processors, those that this process may run on (its affinity) or those that its control groups' quotas
/// of time amount to, rounded up: the least of the three, and at least 1. Reads a few small files on Linux, where the
/// limits are known; elsewhere it is the machine's number.
[[nodiscard]] inline std::size_t available_processors() {
  std::size_t processors = std::max<std::size_t>(1, std::thread::hardware_concurrency());
#if defined(__linux__)
  processors = std::min(processors, detail::processors_of_affinity());
  processors =
      std::min(processors, detail::processors_of_groups(detail::kernel_text("/proc/self/cgroup"), "/sys/fs/cgroup"));
#endif
  return std::max<std::size_t>(1, processors);
}

}  // namespace compmark
