// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The published HiDDeN decoders: logits of the original network on an image given by a formula.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/watermark/decoder/decoder_file.hpp"
#include "compmark/watermark/decoder/decoder_winograd.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "support/data.hpp"

namespace {

using namespace compmark;

TEST_CASE("mark/hidden_decoder: hidden_48 gives the published logits to 1e-5, at any thread count") {
  const auto data = testing::data_dir();
  if (!data || !std::filesystem::exists(*data / "weights/hidden_48.safetensors")) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  const auto file = read_safetensors(*data / "weights/hidden_48.safetensors");
  REQUIRE(file.ok());
  auto weights = read_decoder(*file);
  REQUIRE(weights.ok());
  CHECK(weights->bits == 48);
  CHECK(weights->width == 64);
  CHECK(weights->depth == 8);
  CHECK(weights->input == InputConvention{1, 1, {0, 0, 0}, {1, 1, 1}, 0});  // the raw Haar LL
  weights->input.haar_levels = 0;                                           // the golden image is the network's input
  const auto decoder = HiddenDecoder<48, 64, 8>::create(*weights);
  REQUIRE(decoder.ok());

  std::vector<float> image(3 * 24 * 40);
  for (std::size_t y = 0; y < 24; ++y) {
    for (std::size_t x = 0; x < 40; ++x) {
      image[y * 40 + x] = static_cast<float>((y * 40 + x) % 17) / 16;
      image[960 + y * 40 + x] = static_cast<float>((3 * y + 5 * x) % 23) / 22;
      image[1920 + y * 40 + x] = static_cast<float>(y * x % 19) / 18;
    }
  }
  std::ifstream golden(*data / "weights/hidden_48_golden.txt");
  std::vector<double> expected;
  for (double value = 0; golden >> value;) expected.push_back(value);
  REQUIRE(expected.size() == 48);
  for (const std::size_t threads : {1u, 2u}) {
    ThreadExecutor executor(threads);
    HiddenDecoder<48, 64, 8>::Context context;
    std::vector<float> logits(48);
    decoder->forward({image.data(), 3, 24, 40}, logits, context, executor);
    double worst = 0;
    for (std::size_t i = 0; i < 48; ++i)
      worst = std::max(worst, std::abs(static_cast<double>(logits[i]) - expected[i]));
    MESSAGE("largest difference " << worst);
    CHECK(worst < 1e-5);  // measured 4.5e-7

    const auto winograd = HiddenDecoder<48, 64, 8, float, WinogradOrDirect>::create(*weights);
    HiddenDecoder<48, 64, 8, float, WinogradOrDirect>::Context other;
    winograd->forward({image.data(), 3, 24, 40}, logits, other, executor);
    worst = 0;
    for (std::size_t i = 0; i < 48; ++i)
      worst = std::max(worst, std::abs(static_cast<double>(logits[i]) - expected[i]));
    MESSAGE("largest difference with Winograd " << worst);
    CHECK(worst < 1e-5);
  }
}

TEST_CASE("mark/decoder_file: every published decoder loads with its own length") {
  const auto data = testing::data_dir();
  if (!data || !std::filesystem::exists(*data / "weights/hidden_16.safetensors")) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  for (const auto& [name, bits] : {std::pair{"hidden_48_other", 48}, {"hidden_16", 16}}) {
    const auto file = read_safetensors(*data / "weights" / (std::string(name) + ".safetensors"));
    REQUIRE(file.ok());
    const auto weights = read_decoder(*file);
    REQUIRE(weights.ok());
    CHECK(weights->bits == bits);
    CHECK(weights->layers.size() == 9);
    CHECK(!require_bits(*weights, 32, file->path).ok());
  }
  const auto lpips = read_safetensors(*data / "weights/lpips_alex.safetensors");
  REQUIRE(lpips.ok());
  const auto refused = read_decoder(*lpips);
  REQUIRE(!refused.ok());
  CHECK(refused.error().field == "blocks.0.conv.weight");
}

}  // namespace
