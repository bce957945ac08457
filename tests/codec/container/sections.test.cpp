// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/container/inspect.hpp"
#include "compmark/codec/container/mask_coding.hpp"
#include "compmark/codec/container/network_coding.hpp"
#include "compmark/codec/hac/hac_format.hpp"
#include "compmark/core/executor.hpp"
#include "support/codec_model.hpp"

namespace {

using namespace compmark;

TEST_CASE("container/network_coding: tensors come back as they are stored, and then no longer change") {
  const Random random(2, 0, random_stage("sections"));
  for (const int bits : {2, 5, 8, 10, 16}) {
    CodecTensor tensor{"w", {6, 50}, {}, TensorStorage::integer, bits};
    for (std::uint64_t i = 0; i < 300; ++i)
      tensor.values.push_back(static_cast<float>(random.normal(i) * std::exp2(static_cast<double>(i / 50) * 3 - 9)));
    for (std::size_t i = 250; i < 300; ++i) tensor.values[i] = 0;  // a row of zeros
    const auto once = decode_networks(encode_networks(std::span(&tensor, 1)));
    REQUIRE(once.ok());
    const auto twice = decode_networks(encode_networks(*once));
    REQUIRE(twice.ok());
    CHECK(*once == *twice);
    CHECK((*once)[0].storage == TensorStorage::integer);
    for (std::size_t row = 0; row < 6; ++row) {
      float most = 0;
      for (std::size_t c = 0; c < 50; ++c) most = std::max(most, std::abs(tensor.values[50 * row + c]));
      const double unit = static_cast<double>(most) / ((1 << (bits - 1)) - 1);  // the exponent wastes less than one bit
      for (std::size_t c = 0; c < 50; ++c) {
        REQUIRE(std::abs((*once)[0].values[50 * row + c] - tensor.values[50 * row + c]) <= 1.001 * unit);
      }
    }
  }
  CodecTensor huge{"w", {2}, {1e30f, 1}, TensorStorage::integer, 8};
  const auto wider = decode_networks(encode_networks(std::span(&huge, 1)));
  REQUIRE(wider.ok());
  CHECK((*wider)[0].storage == TensorStorage::single);
  CHECK((*wider)[0].values == huge.values);
}

TEST_CASE("container/network_coding: bits that no writer writes, and weights that do not fit in theirs, are refused") {
  const CodecTensor tensor{"w", {2, 2}, {127, -127, 1, 0}, TensorStorage::integer, 8};
  const std::vector<std::byte> good = encode_networks(std::span(&tensor, 1));
  const std::size_t bits = 4 + 1 + 1 + 1;  // number of tensors, length of the name, the name, storage
  REQUIRE(good[bits] == std::byte{8});
  REQUIRE(decode_networks(good).ok());
  for (const int wrong : {0, 1, 17, 255, 7}) {  // in 7 bits 127 does not fit
    std::vector<std::byte> bytes = good;
    bytes[bits] = static_cast<std::byte>(wrong);
    const auto refused = decode_networks(bytes);
    REQUIRE(!refused.ok());
    CHECK(refused.error().field == "NETR");
    CHECK(refused.error().problem.find("bits") != std::string::npos);
  }
}

TEST_CASE("container/file_format: a text longer than a writer writes is refused, the longest is read") {
  CodecModel model = testing::make_codec_model(3, {.anchors = 1});
  model.metadata["note"] = std::string(CodecLimits::text, 'x');
  CodecModel back;
  CHECK(detail::decode_meta(detail::encode_meta(model, 1), back).ok());
  model.metadata["note"] = std::string(CodecLimits::text + 1, 'x');
  const auto refused = detail::decode_meta(detail::encode_meta(model, 1), back);
  REQUIRE(!refused.ok());
  CHECK(refused.error().problem.find("2^20") != std::string::npos);
}

TEST_CASE("container/network_coding: weights take less than their bits") {
  const Random random(3, 0, random_stage("sections"));
  CodecTensor tensor{"w", {100, 96}, {}, TensorStorage::half};
  for (std::uint64_t i = 0; i < 9600; ++i) tensor.values.push_back(static_cast<float>(0.1 * random.normal(i)));
  CHECK(encode_networks(std::span(&tensor, 1)).size() < 9600 * 2 * 0.85);
  tensor.storage = TensorStorage::integer;
  CHECK(encode_networks(std::span(&tensor, 1)).size() < 9600 * 10 / 8 * 0.95);
}

TEST_CASE("container/mask_coding: masks come back; all unmasked, or each like its neighbours, costs little") {
  const Random random(4, 0, random_stage("sections"));
  for (const int k : {1, 2, 10, 32}) {
    const std::uint32_t all = k == 32 ? ~0u : (1u << k) - 1;
    std::vector<std::uint32_t> masks;
    for (std::uint64_t i = 0; i < 4096; ++i) {
      const auto mask = static_cast<std::uint32_t>(random.bits(i) >> 8) & all;
      masks.push_back(mask == 0 ? 1 : mask);
    }
    std::vector<std::uint32_t> back(masks.size());
    const std::vector<std::byte> bytes = encode_masks(masks, k);
    REQUIRE(decode_masks(bytes, k, back).ok());
    CHECK(back == masks);
    CHECK(static_cast<double>(bytes.size()) < 4096 * k / 8.0 * 1.02 + 40);
    std::fill(masks.begin(), masks.end(), all);
    CHECK(encode_masks(masks, k).size() < 100);
  }
  const double masked = 0,
               share = masked /
                       4096;  // negative control (AN9): the bits of an offset that is masked, were its share counted
  CHECK_FALSE(std::isfinite(-std::log2(share)));
  CHECK(encode_masks({}, 10).empty());
  CHECK(decode_masks({}, 10, {}).ok());
}

TEST_CASE(
    "container/hac_format: a grid of equal signs encodes to less than 64 bytes (case CO1), and entries nobody reads to "
    "none") {
  const HashGridShape shape;
  IntegerHashGrid grid(shape, VoxelBox{});
  std::fill(grid.entries().begin(), grid.entries().end(), std::uint8_t{15});
  const std::size_t fixed = 4 + 16 * 4 + 3 * 13;
  std::vector<std::uint8_t> seen(shape.entries(), 1);
  CHECK(detail::encode_hash_grid(grid, seen).size() < fixed + 64);
  std::fill(seen.begin(), seen.end(), std::uint8_t{0});
  CHECK(detail::encode_hash_grid(grid, seen).size() == fixed);
  CHECK(grid.entries()[7] == 0);
}

TEST_CASE("container/inspect: a file is described without being decoded, damaged sections are named") {
  SerialExecutor executor;
  const auto file = encode_hac(testing::make_codec_model(31), {}, executor);
  REQUIRE(file.ok());
  const auto info = inspect_cmk(file->bytes, "a.cmk");
  REQUIRE(info.ok());
  CHECK(info->anchors == file->report.anchors);
  CHECK(info->numbers.metadata == file->model.metadata);
  CHECK(info->numbers.voxel_size == file->model.voxel_size);
  CHECK(info->damaged.empty());
  for (const std::uint32_t kind : HacFormat::known) CHECK(info->bytes_of(kind) == file->report.bytes_of(kind));
  std::vector<std::byte> bytes = file->bytes;
  bytes.back() ^= std::byte{1};  // DIGS
  const auto damaged = inspect_cmk(bytes, "a.cmk");
  REQUIRE(damaged.ok());
  CHECK(damaged->damaged == std::vector<std::string>{"DIGS"});
  CHECK(!inspect_cmk(std::span<const std::byte>(bytes).first(100), "a.cmk").ok());
}

}  // namespace

TEST_CASE(
    "container/network_coding: a network of more weights than its bytes hold is refused before they are made room "
    "for") {
  ByteWriter writer;
  writer.put(std::uint32_t{4096});
  for (int i = 0; i < 5 * (4096 + 4096); ++i) writer.put(std::uint8_t{0});
  const Result<IntegerNetwork> network = decode_context_network(writer.bytes(), 4096, 4096);  // 64 MiB from 41 KB
  REQUIRE_FALSE(network);
  CHECK(network.error().problem.find("weights are more than its bytes hold") != std::string::npos);
}

TEST_CASE("container/codec_model: a hyperprior without anchors is refused, not divided by") {
  CodecModel model = testing::make_codec_model(1);
  CHECK(detail::check_codec_model(model).ok());
  model.voxels.clear();
  model.mask.clear();
  for (std::vector<float>* part : {&model.feature, &model.scale, &model.offset}) part->clear();
  CHECK(detail::check_codec_model(model).ok());
  model.hyperprior = {1};
  CHECK_FALSE(detail::check_codec_model(model).ok());
}
