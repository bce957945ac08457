// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/watermark/decoder/strided_decoder.hpp"
#include "compmark/watermark/pretrain/conv_network.hpp"
#include "compmark/watermark/pretrain/lattice_network.hpp"

using namespace compmark;

namespace {

std::vector<double> uniforms(std::size_t count, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("test/pretrain network"));
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = random.uniform(i);
  return values;
}

/// Two images of different sizes, a loss that is linear in the logits, and every gradient against central differences.
template <class Network>
void check_gradients(Network& network, ParameterArena<double>& arena, double tolerance) {
  const int sizes[2][2] = {{18, 14}, {13, 20}};
  std::vector<std::vector<double>> pixels, d_pixels;
  std::vector<ImageView<const double>> images;
  std::vector<ImageView<double>> d_images;
  for (std::size_t i = 0; i < 2; ++i) {
    const std::size_t count = 3 * static_cast<std::size_t>(sizes[i][0]) * static_cast<std::size_t>(sizes[i][1]);
    pixels.push_back(uniforms(count, i));
    d_pixels.emplace_back(count, 0.0);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    images.push_back({pixels[i].data(), 3, sizes[i][0], sizes[i][1]});
    d_images.push_back({d_pixels[i].data(), 3, sizes[i][0], sizes[i][1]});
  }
  const std::size_t count = 2 * static_cast<std::size_t>(network.bits());
  std::vector<double> logits(count), slope = uniforms(count, 7);
  for (double& s : slope) s -= 0.4;
  SerialExecutor executor;
  typename Network::Context context;
  const auto loss = [&] {
    network.forward(arena, images, std::span<double>(logits), context, executor);
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += slope[i] * logits[i];
    return sum;
  };
  static_cast<void>(loss());
  network.backward(arena, slope, d_images, context, executor);
  const std::vector<double> gradients(arena.all_gradients().begin(), arena.all_gradients().end());
  std::size_t block_index = 0;
  const std::vector<double> rates = network.rates(1.0);
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    CAPTURE(block.name);
    if (rates[block_index++] == 0) continue;  // running statistics
    const std::span<const double> gradient = std::span<const double>(gradients).subspan(block.offset, block.size());
    if (block.name.find("conv.bias") != std::string::npos) {  // normalisation takes a bias out again: zero to rounding
      for (const double g : gradient) CHECK(std::abs(g) < 1e-12);
      continue;
    }
    CHECK(testing::gradient_law(loss, arena.all_values().subspan(block.offset, block.size()), gradient, tolerance,
                                24) == "");
  }
  for (std::size_t i = 0; i < 2; ++i) CHECK(testing::gradient_law(loss, pixels[i], d_pixels[i], tolerance, 24) == "");

  ThreadExecutor threads(3);  // the same bits
  typename Network::Context other;
  static_cast<void>(loss());
  const std::vector<double> first = logits;
  for (double& g : arena.all_gradients()) g = 0;
  network.forward(arena, images, std::span<double>(logits), other, threads);
  network.backward(arena, slope, d_images, other, threads);
  CHECK(std::vector<double>(arena.all_gradients().begin(), arena.all_gradients().end()) == gradients);
  CHECK(logits == first);
}

ConvNetworkSettings small_network() {
  ConvNetworkSettings settings;
  settings.bits = 3;
  settings.width = 5;
  settings.depth = 2;
  settings.features = 4;
  return settings;
}

}  // namespace

TEST_CASE("pretrain/pretrain_network: the lattice's gradients in a batch") {
  LatticeSettings settings;
  settings.bits = 3;
  settings.features = 6;
  settings.sigma = {1, 2, 4};
  settings.stride = 2;
  LatticeDecoder<double> decoder(settings, random_lattice<double>(settings, std::vector<double>{0.5, 0.4}, 1));
  std::size_t n = 0;
  for (double& h : decoder.weights().head) h = std::cos(static_cast<double>(n++));
  ParameterArena<double> arena;
  LatticeNetwork<double> network(decoder, arena);
  check_gradients(network, arena, 1e-6);
}

TEST_CASE("pretrain/pretrain_network: convolution, batch normalisation, GELU, mean and linear in a batch") {
  ParameterArena<double> arena;
  ConvNetwork<double> network(small_network(), arena);
  check_gradients(network, arena, 2e-6);
}

TEST_CASE("pretrain/pretrain_network: the frozen decoder with the batch's statistics gives the training's logits") {
  ConvNetworkSettings settings = small_network();
  settings.momentum = 1;  // the running statistics are those of the last batch
  ParameterArena<float> arena;
  ConvNetwork<float> network(settings, arena);
  const std::vector<double> values = uniforms(3 * 40 * 40, 3);
  std::vector<float> pixels(values.begin(), values.end());
  const ImageView<const float> image{pixels.data(), 3, 40, 40};
  std::vector<float> trained(3), frozen(3);
  SerialExecutor executor;
  ConvNetwork<float>::Context context;
  network.forward(arena, std::span<const ImageView<const float>>(&image, 1), trained, context, executor);
  const auto decoder = StridedDecoder<>::create(network.decoder_weights(arena));
  REQUIRE(decoder);
  StridedDecoder<>::Context frozen_context;
  decoder->forward(image, std::span<float>(frozen), frozen_context, executor);
  // The running variance is n / (n - 1) times the batch's (n = 400 here): 1.3e-3 relative a block.
  for (std::size_t b = 0; b < 3; ++b) CHECK(std::abs(trained[b] - frozen[b]) < 0.01f * (1 + std::abs(trained[b])));
}

TEST_CASE(
    "pretrain/pretrain_network: images of one grey are read by the statistics of training, not by their own (ML6)") {
  ConvNetworkSettings settings = small_network();
  settings.momentum = 1;
  ParameterArena<float> arena;
  ConvNetwork<float> network(settings, arena);
  const std::vector<double> values = uniforms(3 * 40 * 40, 3);
  std::vector<float> pixels(values.begin(), values.end());
  SerialExecutor executor;
  ConvNetwork<float>::Context context;
  StridedDecoder<>::Context frozen_context;
  const ImageView<const float> image{pixels.data(), 3, 40, 40};
  const std::span<const ImageView<const float>> batch(&image, 1);
  std::array<float, 3> bright{}, grey{}, own_bright{}, own_grey{};
  network.forward(arena, batch, std::span<float>(grey), context, executor);
  const auto decoder = StridedDecoder<>::create(network.decoder_weights(arena));
  REQUIRE(decoder);
  const auto read = [&](float value, std::span<float> frozen, std::span<float> own) {
    std::fill(pixels.begin(), pixels.end(), value);
    decoder->forward(image, frozen, frozen_context, executor);
    network.forward(arena, batch, own, context, executor);
  };
  read(0.9f, bright, own_bright);
  read(0.6f, grey, own_grey);
  float difference = 0, own_difference = 0;
  for (std::size_t b = 0; b < 3; ++b) {
    CHECK(std::isfinite(bright[b]));
    CHECK(std::isfinite(grey[b]));
    difference = std::max(difference, std::abs(bright[b] - grey[b]));
    own_difference = std::max(own_difference, std::abs(own_bright[b] - own_grey[b]));
  }
  MESSAGE("two greys differ by ", difference, ", by their own statistics by ", own_difference);
  CHECK(difference >
        3 * own_difference);  // negative control: normalised by itself, one grey is nearly every grey; 4.7 measured
}

TEST_CASE("pretrain/pretrain_network: running statistics move by the momentum") {
  ParameterArena<double> arena;
  ConvNetwork<double> network(small_network(), arena);
  const std::vector<double> pixels = uniforms(3 * 16 * 16, 5);
  const ImageView<const double> image{pixels.data(), 3, 16, 16};
  std::vector<double> logits(3);
  SerialExecutor executor;
  ConvNetwork<double>::Context context;
  const std::span<double> mean = arena.values(arena.layout().find("blocks.0.bn.running_mean")).flat();
  network.forward(arena, std::span<const ImageView<const double>>(&image, 1), logits, context, executor);
  const double first = mean[0];
  CHECK(first != 0);
  network.forward(arena, std::span<const ImageView<const double>>(&image, 1), logits, context, executor);
  CHECK(mean[0] == doctest::Approx(first * 1.99));  // m, then m + 0.99 m of the same batch
}
