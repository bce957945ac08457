// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The largest memory of a part of a process: a program of many runs says of each what that one took, or that it is not
// known.
#include <doctest/doctest.h>

#include <compmark/io/atomic_file.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "compmark/machine_memory.cpp"
#include "support/tool.hpp"

namespace memory_test {

namespace {

using compmark::testing::ScratchFolder;

/// Takes so many bytes, writes into each page, and gives them back.
void take_memory(std::size_t bytes) {
  const std::vector<std::byte> taken(bytes, std::byte{1});
  volatile std::byte last = taken.back();
  static_cast<void>(last);
}

}  // namespace

TEST_CASE("memory: a part of a process has its own largest memory, not that of a part before") {
  constexpr double large = 300e6, small = 60e6;
  take_memory(static_cast<std::size_t>(large));
  const std::optional<double> whole = tool::PeakMemory().mb();
  REQUIRE(whole);
  CHECK(*whole > large / 1e6);
  const tool::PeakMemory part = tool::PeakMemory::from_now();
  take_memory(static_cast<std::size_t>(small));
  const std::optional<double> own = part.mb();
  if (own) {  // nothing: this system cannot set its mark back
    CHECK(*own > small / 1e6);
    CHECK(*own < *whole - (large - small) / 2 / 1e6);
  }
  take_memory(static_cast<std::size_t>(2 * large));  // what is more than all before is known everywhere
  REQUIRE(part.mb());
  CHECK(*part.mb() > 2 * large / 1e6);
}

TEST_CASE("memory: where the system cannot set its mark back, what is not known is not said") {
  const ScratchFolder scratch("compmark-memory-test");
  std::filesystem::create_directories(scratch.path / "proc/self");
  const auto say = [&](long mark, long resident) {  // MB
    REQUIRE(compmark::write_file(scratch.path / "proc/self/status",
                                 "Name:\ttest\nVmHWM:\t" + std::to_string(mark * 1000000 / 1024) + " kB\nVmRSS:\t" +
                                     std::to_string(resident * 1000000 / 1024) + " kB\n")
                .ok());
  };
  say(500, 100);
  const tool::PeakMemory part = tool::PeakMemory::from_now(scratch.path);
  CHECK_FALSE(part.mb());  // an earlier part took 500
  say(500, 450);
  CHECK_FALSE(part.mb());
  say(600, 450);
  REQUIRE(part.mb());
  CHECK(*part.mb() == doctest::Approx(600).epsilon(0.001));
  // The control: a mark that is where the memory is.
  say(101, 100);
  const tool::PeakMemory known = tool::PeakMemory::from_now(scratch.path);
  REQUIRE(known.mb());
  CHECK(*known.mb() == doctest::Approx(101).epsilon(0.001));
}

}  // namespace memory_test
