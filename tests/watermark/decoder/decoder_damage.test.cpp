// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Damage of decoder files of every kind: an error, or nothing that is read is another. A decoder with one other number
// reads another message.
#include <doctest/doctest.h>

#include <string>
#include <utility>
#include <vector>

#include "compmark/io/safetensors.hpp"
#include "compmark/watermark/decoder/decoder_file.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"
#include "compmark/watermark/decoder/stored_decoder.hpp"
#include "support/damage.hpp"
#include "support/decoder.hpp"
#include "support/scene_files.hpp"

namespace {

using namespace compmark;

DecoderWeights carrier_weights() {
  DecoderWeights weights = testing::small_decoder(4, 5, 2);
  weights.kind = DecoderKind::carrier;
  weights.bits = 0;
  weights.linear_weight.clear();
  weights.linear_bias.clear();
  weights.layers[1].pool = weights.layers[1].tap = true;
  weights.whiten_weight.assign(3 * static_cast<std::size_t>(weights.features()), 0.5f);
  weights.whiten_bias.assign(3, -1.0f);
  return weights;
}

LatticeDecoder<float> lattice(LatticeMeasure measure, bool cover, bool limited) {
  LatticeSettings settings;
  settings.measure = measure;
  settings.bits = 6;
  settings.features = 9;
  settings.sigma = {1.5, 3, 6};
  if (limited) {
    settings.regions = 16;
    settings.region_limit = 0.5;
  }
  LatticeWeights<float> weights(settings);
  if (cover) {
    weights.cover.direction.resize(2 * 9);
    weights.cover.offset.resize(2);
    weights.cover.centre.resize(5 * 2);
    weights.cover.coefficient.resize(5 * 6);
  }
  const Random random(5, 0, random_stage("decoder damage"));
  std::uint64_t at = 0;
  for (std::vector<float>* part :
       {&weights.frequency, &weights.phase, &weights.head, &weights.bias, &weights.cover.direction,
        &weights.cover.offset, &weights.cover.centre, &weights.cover.coefficient}) {
    for (float& value : *part) value = static_cast<float>(random.normal(at++));
  }
  return {settings, weights};
}

TEST_CASE("decoder/decoder_damage: of decoder files of every kind no damage is accepted as another decoder") {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "decoder.safetensors";
  const auto check = [&](const std::string& kind, const Result<Done>& written) {
    REQUIRE(written.ok());
    testing::check_tensor_damage(kind, *read_file(path), [](const SafetensorsFile& file, const testing::FileBytes&) {
      return expect_kind(file, FileKind::decoder).ok() &&
             StoredDecoder<float>::read(file, DecoderKey{{1, 2, 3, 4}, 2}).ok();
    });
  };
  check("a hidden decoder", write_decoder<SafetensorsWriter>(testing::small_decoder(4, 5, 2), path));
  check("a strided decoder", write_decoder<SafetensorsWriter>(testing::small_decoder(4, 5, 1, 2), path));
  check("a carrier decoder", write_decoder<SafetensorsWriter>(carrier_weights(), path));
  check("a lattice of contrast",
        write_lattice<SafetensorsWriter>(lattice(LatticeMeasure::contrast, false, false), "", path));
  check("a lattice of colour with a cover prediction",
        write_lattice<SafetensorsWriter>(lattice(LatticeMeasure::colour, true, false), "a note", path));
  check("a lattice with limited regions",
        write_lattice<SafetensorsWriter>(lattice(LatticeMeasure::colour, true, true), "a note", path));
}

TEST_CASE("decoder/decoder_damage: layers that shrink every image to nothing are refused, at once") {
  // 16^n pixels a side: with 8 such layers more than an int counts, and a search for the size would not end.
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "decoder.safetensors";
  for (const std::size_t count : {3u, 4u, 5u, 8u, 64u}) {
    CAPTURE(count);
    DecoderWeights weights;
    weights.kind = DecoderKind::carrier;
    weights.layers.resize(count);
    for (std::size_t l = 0; l < count; ++l) {
      weights.layers[l].shape = {l == 0 ? 3 : 1, 1, 16, 16, 0};
      weights.layers[l].weight.assign(weights.layers[l].shape.taps(), 0.1f);
      weights.layers[l].bias.assign(1, 0.0f);
    }
    weights.layers.back().tap = true;
    weights.width = 1;
    weights.depth = 1;
    weights.whiten_weight.assign(1, 1.0f);
    weights.whiten_bias.assign(1, 0.0f);
    REQUIRE(write_decoder<SafetensorsWriter>(weights, path).ok());
    const auto read = StoredDecoder<float>::read(*read_safetensors(path), DecoderKey{{1, 2, 3, 4}, 1});
    CHECK(read.ok() == (count <= 4));  // 65536
    if (read.ok()) {
      CHECK(read->minimum_size() == (1 << 4 * count) << weights.input.haar_levels);
    } else {
      CHECK(read.error().field == "__metadata__.layers");
    }
  }
}

TEST_CASE("decoder/decoder_damage: the smallest input is that which leaves each layer one position") {
  const Random random(6, 0, random_stage("smallest input"));
  for (std::uint64_t i = 0; i < 200; ++i) {
    std::vector<DecoderLayer> layers(1 + random.below(8 * i, 4));
    for (std::size_t l = 0; l < layers.size(); ++l) {
      const int kernel = 1 + static_cast<int>(random.below(100 * i + 4 * l + 1000, 6));
      layers[l].shape = {1, 1, kernel,
                         1 + static_cast<int>(random.below(100 * i + 4 * l + 1001, static_cast<std::size_t>(kernel))),
                         static_cast<int>(random.below(100 * i + 4 * l + 1002, static_cast<std::size_t>(kernel)))};
      layers[l].pool = random.below(100 * i + 4 * l + 1003, 3) == 0;
    }
    const auto fits = [&](int n) {
      for (const DecoderLayer& layer : layers) {
        if (layer.pool) n = n < 3 ? 0 : max_pool_size(n);
        if (n < 1 || n + 2 * layer.shape.padding < layer.shape.kernel) return false;
        n = layer.shape.output_size(n);
      }
      return true;
    };
    const int smallest = smallest_input(layers);
    REQUIRE(smallest >= 1);
    CHECK(fits(smallest));
    CHECK((smallest == 1 || !fits(smallest - 1)));
  }
}

}  // namespace
