// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/processors.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "support/tool.hpp"

#if defined(__linux__)
#include <sched.h>
#endif

using namespace compmark;

TEST_CASE("core/processors: a quota of time is so many processors, rounded up") {
  constexpr std::size_t none = detail::no_processor_limit;
  CHECK(detail::processors_of_quota("200000", "100000") == 2);
  CHECK(detail::processors_of_quota("150000", "100000") == 2);
  CHECK(detail::processors_of_quota("100001", "100000") == 2);
  CHECK(detail::processors_of_quota("1000", "100000") == 1);
  CHECK(detail::processors_of_quota("50000\n", "25000\n") == 2);
  CHECK(detail::processors_of_quota("max", "100000") == none);
  CHECK(detail::processors_of_quota("-1", "100000") == none);
  CHECK(detail::processors_of_quota("100000", "0") == none);
  CHECK(detail::processors_of_quota("", "") == none);
  CHECK(detail::processors_of_quota("9223372036854775807", "1") == 9223372036854775807u);
}

#if defined(__linux__)
namespace {
namespace processors_test {

struct Groups {
  testing::ScratchFolder folder;
  explicit Groups(const std::string& name) : folder(name) {}
  void write(const std::string& path, const std::string& text) const {
    std::filesystem::create_directories((folder.path / path).parent_path());
    std::ofstream(folder.path / path) << text;
  }
  [[nodiscard]] std::size_t limit(const std::string& proc) const {
    return detail::processors_of_groups(proc, folder.path.string());
  }
};

}  // namespace processors_test
}  // namespace

TEST_CASE("core/processors: the least quota between a control group and the root counts, in both versions") {
  constexpr std::size_t none = detail::no_processor_limit;
  const processors_test::Groups two("compmark-groups-2");
  CHECK(two.limit("0::/job/step\n") == none);
  two.write("job/step/cpu.max", "max 100000\n");
  CHECK(two.limit("0::/job/step\n") == none);
  two.write("job/cpu.max", "300000 100000\n");
  CHECK(two.limit("0::/job/step\n") == 3);
  two.write("job/step/cpu.max", "50000 100000\n");
  CHECK(two.limit("0::/job/step\n") == 1);
  CHECK(two.limit("0::/job\n") == 3);
  CHECK(two.limit("0::/\n") == none);
  two.write("cpu.max", "200000 100000\n");
  CHECK(two.limit("0::/\n") == 2);
  CHECK(two.limit("0::/job\n") == 2);

  const processors_test::Groups one("compmark-groups-1");
  one.write("cpu/docker/7/cpu.cfs_quota_us", "250000\n");
  one.write("cpu/docker/7/cpu.cfs_period_us", "100000\n");
  const std::string proc = "5:cpuset:/\n4:cpu,cpuacct:/docker/7\n3:memory:/docker/7\n";
  CHECK(one.limit(proc) == 3);
  one.write("cpu/docker/7/cpu.cfs_quota_us", "-1\n");
  CHECK(one.limit(proc) == none);
  for (const char* const broken : {"", "\n", ":", "::", "0:", "0::", "0::..", "no colon\n", "4:cpu\n"}) {
    CHECK(one.limit(broken) == none);
  }
}

TEST_CASE("core/processors: who is pinned to one processor has one") {
  const std::size_t before = available_processors();
  CHECK(before >= 1);
  CHECK(before <= std::thread::hardware_concurrency());
  cpu_set_t saved;
  CPU_ZERO(&saved);
  REQUIRE(::sched_getaffinity(0, sizeof(saved), &saved) == 0);
  cpu_set_t one;
  CPU_ZERO(&one);
  for (std::size_t i = 0; i < CPU_SETSIZE; ++i) {
    if (!CPU_ISSET(i, &saved)) continue;
    CPU_SET(i, &one);
    break;
  }
  REQUIRE(::sched_setaffinity(0, sizeof(one), &one) == 0);
  const std::size_t pinned = available_processors();
  REQUIRE(::sched_setaffinity(0, sizeof(saved), &saved) == 0);
  CHECK(pinned == 1);
  CHECK(available_processors() == before);
}

TEST_CASE("core/processors: a set of processors that is too small for the machine is tried again") {
  // Into no room at all the system writes nothing, as into 1,024 processors' on a machine that could have more.
  CHECK(::sched_getaffinity(0, 0, nullptr) != 0);
  CHECK(detail::processors_of_affinity(0) == detail::processors_of_affinity());
  CHECK(detail::processors_of_affinity(0) <= std::thread::hardware_concurrency());
}
#endif
