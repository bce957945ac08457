// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The edit by itself, on an arena with all kinds of blocks; a trained model and its message are edited in tests/tool.
#include "compmark/watermark/attack/quantize_model.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/splat/quantizer/int8_quantizer.hpp"

namespace {

using namespace compmark;
using Quantizer = Int8Quantizer<float>;

struct Blocks {
  ParameterArena<float> arena;
  Blocks() {
    const auto add = [&](const char* name, std::size_t rows, std::size_t columns, RowKind kind, BlockRole role,
                         double scale) {
      const MatrixView<float> values =
          arena.values(arena.add(name, rows, columns, kind, role, LearningSchedule::fixed()));
      const Random random(1, 0, random_stage(name));
      for (std::size_t i = 0; i < values.size(); ++i) {
        values.data[i] =
            static_cast<float>(scale * random.normal(i) * std::pow(10.0, static_cast<double>(i % columns % 3)));
      }
    };
    add("anchor.position", 50, 3, RowKind::anchor, BlockRole::rendering, 1);
    add("anchor.feature", 50, 32, RowKind::anchor, BlockRole::rendering, 1);
    add("anchor.scaling", 50, 6, RowKind::anchor, BlockRole::rendering, 1);
    add("anchor.mask", 50, 10, RowKind::anchor, BlockRole::mask, 1);
    add("anchor.hyperprior", 50, 4, RowKind::anchor, BlockRole::context, 1);
    add("mlp_color.0.weight", 32, 35, RowKind::fixed, BlockRole::rendering, 0.1);
    add("mlp_color.0.bias", 1, 32, RowKind::fixed, BlockRole::rendering, 0.1);
    add("hash_grid", 100, 4, RowKind::fixed, BlockRole::context, 1);
    add("context.0.weight", 10, 96, RowKind::fixed, BlockRole::context, 1);
    add("context_gs.0.0.weight", 10, 96, RowKind::fixed, BlockRole::context, 1);
    add("distortion.0.weight", 32, 32, RowKind::fixed, BlockRole::training, 1);
  }
  [[nodiscard]] std::vector<float> of(const char* name) const {
    const MatrixView<const float> values = arena.values(arena.layout().find(name));
    return {values.data, values.data + values.size()};
  }
};

Quantizer int8(Int8Channels channels) { return *Quantizer::create({Int8Scheme::affine, channels}); }

TEST_CASE("attack/quantize_model: what a render reads is rounded, nothing else, and the report says by how much") {
  const Blocks before;
  Blocks after;
  const auto report = quantize_model(after.arena, int8(Int8Channels::tensor), int8(Int8Channels::tensor));
  REQUIRE(report);
  std::set<std::string> names;
  for (const QuantizedBlock& block : *report) {
    names.insert(block.name);
    const std::vector<float> a = before.of(block.name.c_str()), b = after.of(block.name.c_str());
    CHECK(block.values == a.size());
    CHECK(std::set<float>(b.begin(), b.end()).size() <= 256);
    double squares = 0, largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double error = static_cast<double>(b[i]) - static_cast<double>(a[i]);
      squares += error * error;
      largest = std::max(largest, std::abs(error));
    }
    CHECK(block.rms_error == doctest::Approx(std::sqrt(squares / static_cast<double>(a.size()))));
    CHECK(block.largest_error == largest);
    CHECK(block.rms_error > 0);
    CHECK(block.deviation > block.rms_error);
  }
  CHECK(names == std::set<std::string>{"anchor.feature", "anchor.position", "anchor.scaling", "mlp_color.0.bias",
                                       "mlp_color.0.weight"});
  for (const char* kept : {"anchor.mask", "anchor.hyperprior", "hash_grid", "context.0.weight", "context_gs.0.0.weight",
                           "distortion.0.weight"}) {
    CHECK(before.of(kept) == after.of(kept));
  }
}

TEST_CASE("attack/quantize_model: settings keep positions or networks; a scale a channel is nearer") {
  const Blocks before;
  Blocks kept, whole, fine;
  REQUIRE(quantize_model(kept.arena, int8(Int8Channels::tensor), int8(Int8Channels::tensor),
                         {kept.arena.layout().find("anchor.position"), false}));
  CHECK(kept.of("anchor.position") == before.of("anchor.position"));
  CHECK(kept.of("mlp_color.0.weight") == before.of("mlp_color.0.weight"));
  CHECK(kept.of("anchor.scaling") != before.of("anchor.scaling"));
  const auto coarse = quantize_model(whole.arena, int8(Int8Channels::tensor), int8(Int8Channels::tensor));
  const auto nearer = quantize_model(fine.arena, int8(Int8Channels::columns), int8(Int8Channels::rows));
  REQUIRE(coarse);
  REQUIRE(nearer);
  // Columns differ a hundredfold. What is large keeps its error; that of the rest falls to a tenth and a hundredth: rms
  // to sqrt(1/3).
  REQUIRE(coarse->size() == nearer->size());
  REQUIRE(coarse->size() >= 4);
  for (std::size_t i = 0; i < coarse->size(); ++i) {
    CAPTURE((*coarse)[i].name);
    if ((*coarse)[i].name.starts_with("anchor")) CHECK((*nearer)[i].rms_error < 0.65 * (*coarse)[i].rms_error);
  }
}

TEST_CASE("attack/quantize_model: a value that is not finite is refused by its place") {
  Blocks blocks;
  blocks.arena.values(blocks.arena.layout().find("anchor.scaling"))(7, 2) = std::numeric_limits<float>::quiet_NaN();
  const auto refused = quantize_model(blocks.arena, int8(Int8Channels::tensor), int8(Int8Channels::tensor));
  REQUIRE_FALSE(refused);
  CHECK(refused.error().field == "anchor.scaling: row 7, column 2");
}

}  // namespace
