// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/buffer.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>
#include <utility>

// The sanitizers end a program that asks for too much.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define COMPMARK_TEST_ALLOCATION_FAILS 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define COMPMARK_TEST_ALLOCATION_FAILS 0
#endif
#endif
#if !defined(COMPMARK_TEST_ALLOCATION_FAILS)
#define COMPMARK_TEST_ALLOCATION_FAILS 1
#endif

using compmark::Buffer;

TEST_CASE("core/buffer: aligned to 64 bytes, and a whole pack may be loaded at any element") {
  for (const std::size_t count : {std::size_t{1}, std::size_t{15}, std::size_t{16}, std::size_t{1000}}) {
    Buffer<float> buffer(count);
    CHECK(reinterpret_cast<std::uintptr_t>(buffer.data()) % 64 == 0);
    float* last = buffer.data() + count - 1;
    for (int i = 0; i < 16; ++i) last[i] = 1.0f;  // one cache line from the last element: under ASan this is the test
    CHECK(buffer[count - 1] == 1.0f);
  }
}

TEST_CASE("core/buffer: grow-only: memory is taken at most once per growth, never on the way down") {
  Buffer<int> buffer(100);
  const int* first = buffer.data();
  buffer.resize(10);
  CHECK(buffer.data() == first);
  CHECK(buffer.size() == 10);
  buffer.resize(100);
  CHECK(buffer.data() == first);
  buffer.resize(101);  // growth is geometric, so creeping growth does not allocate every time
  CHECK(buffer.capacity_bytes() >= 150 * sizeof(int));
}

#if COMPMARK_TEST_ALLOCATION_FAILS
TEST_CASE("core/buffer: without memory a buffer is empty, and serves again") {
  Buffer<char> buffer(100);
  volatile std::size_t wanted = std::numeric_limits<std::size_t>::max() / 4;  // volatile: no compiler knows the size
  CHECK_THROWS_AS(buffer.resize(wanted), std::bad_alloc);
  CHECK(buffer.size() == 0);
  CHECK(buffer.empty());
  CHECK(buffer.capacity_bytes() == 0);
  CHECK(buffer.span().empty());
  const Buffer<char> copy = buffer;  // which reads no value of it
  CHECK(copy.empty());
  buffer.resize(3, 'x');
  CHECK(buffer[2] == 'x');
}
#endif

TEST_CASE("core/buffer: resize with a value, copy and move") {
  Buffer<double> buffer;
  CHECK(buffer.empty());
  buffer.resize(5, 2.5);
  Buffer<double> copy = buffer;
  copy[0] = 1.0;
  CHECK(buffer[0] == 2.5);
  CHECK(copy[4] == 2.5);
  const double* memory = copy.data();
  const Buffer<double> moved = std::move(copy);
  CHECK(moved.data() == memory);
  CHECK(moved.size() == 5);
  double sum = 0;
  for (const double value : moved) sum += value;
  CHECK(sum == 1.0 + 4 * 2.5);
}
