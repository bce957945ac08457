// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/proof/carrier_stream.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <vector>

using namespace compmark;

TEST_CASE("proof/carrier_stream: the block of RFC 8439 section 2.3.2 and the stream of its appendix A.1") {
  std::array<std::uint32_t, 16> state{0x61707865, 0x3320646e, 0x79622d32, 0x6b206574, 0x03020100, 0x07060504,
                                      0x0b0a0908, 0x0f0e0d0c, 0x13121110, 0x17161514, 0x1b1a1918, 0x1f1e1d1c,
                                      0x00000001, 0x09000000, 0x4a000000, 0x00000000};
  CHECK(chacha20_block(state) == std::array<std::uint32_t, 16>{0xe4e7f110, 0x15593bd1, 0x1fdd0f50, 0xc47120a3,
                                                               0xc7f4d1c7, 0x0368c033, 0x9aaa2204, 0x4e6cd4c3,
                                                               0x466482d2, 0x09aa9f07, 0x05d7c214, 0xa2028bd9,
                                                               0xd19c12b5, 0xb94e16de, 0xe883d0cb, 0x4e3c50a2});
  std::array<std::byte, 70> bytes{};
  chacha20_stream({0, 0, 0, 0}, bytes);  // key 0: test vector 1 of A.1, then the first bytes of test vector 2
  CHECK(bytes[0] == std::byte{0x76});
  CHECK(bytes[1] == std::byte{0xb8});
  CHECK(bytes[2] == std::byte{0xe0});
  CHECK(bytes[15] == std::byte{0x28});
  CHECK(bytes[63] == std::byte{0x86});
  CHECK(bytes[64] == std::byte{0x9f});
  CHECK(bytes[65] == std::byte{0x07});
}

TEST_CASE("proof/carrier_stream: carriers of two keys have nothing in common, those of one key are equal") {
  constexpr int bits = 48, dimension = 96;
  const std::vector<double> a = make_carriers(std::array<std::uint64_t, 4>{1, 2, 3, 4}, bits, dimension);
  CHECK(make_carriers(std::array<std::uint64_t, 4>{1, 2, 3, 4}, bits, dimension) == a);
  const std::vector<double> b = make_carriers(std::array<std::uint64_t, 4>{1, 2, 3, 5}, bits, dimension);
  double square = 0;
  for (std::size_t i = 0; i < bits; ++i) {
    for (std::size_t j = 0; j < bits; ++j) {
      double dot = 0;
      for (std::size_t k = 0; k < dimension; ++k) dot += a[i * dimension + k] * b[j * dimension + k];
      square += dot * dot;
    }
  }
  // The expected square of a cosine in 96 dimensions is 1 / 96; the mean of 48 x 48 of them within a tenth.
  CHECK(std::abs(square / (bits * bits) * dimension - 1) < 0.1);
}
