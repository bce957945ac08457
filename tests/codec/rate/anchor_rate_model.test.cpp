// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What both entropy models take from AnchorRateModel; the gradients of the whole are in hac_model.test.cpp and
// context_gs_model.test.cpp.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/codec/hac/hac_parameters.hpp>
#include <compmark/codec/rate/anchor_rate_model.hpp>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace anchor_rate_model_test {
namespace {

using namespace compmark;

constexpr std::size_t rows = 6, feature_dim = 5, offsets = 2;

/// The model's own parts, in the open.
struct Parts : AnchorRateModel<double, feature_dim, offsets, HacHandles> {
  using Base = AnchorRateModel<double, feature_dim, offsets, HacHandles>;
  using Base::distort, Base::distort_copy, Base::pull_back, Base::pull_back_copy, Base::pull_drawn_steps,
      Base::RowScratch;
  struct Kept : Base::EntryTables {};
  template <class U>
  using Tables = Base::Tables<U>;
};

struct Table {
  std::vector<double> feature, scaling, offset;
  explicit Table(double scale) : feature(rows * feature_dim), scaling(rows * 6), offset(rows * 3 * offsets) {
    double value = 0;
    for (std::vector<double>* of : {&feature, &scaling, &offset}) {
      for (double& v : *of) v = scale * std::sin(value += 0.7);
    }
  }
  Parts::Tables<double> view() {
    return {{feature.data(), rows, feature_dim}, {scaling.data(), rows, 6}, {offset.data(), rows, 3 * offsets}};
  }
  Parts::Tables<const double> read() const {
    return {{feature.data(), rows, feature_dim}, {scaling.data(), rows, 6}, {offset.data(), rows, 3 * offsets}};
  }
  bool operator==(const Table&) const = default;
};

Parts::Kept kept_of(std::size_t entries) {
  Parts::Kept kept;
  kept.phase = {.context = true, .seed = 4, .iteration = 9};
  kept.resize_noise(entries);
  kept.step.resize(entries * 3);
  kept.d_step.resize(entries * 3);
  return kept;
}

constexpr std::array<double, 3> steps{0.5, 0.002, 0.1};

}  // namespace

TEST_CASE(
    "rate/anchor_rate_model: a row that is not listed sees the noise of a listed one and leaves its table alone") {
  const AnchorRateSettings settings;
  const Random random(4, 9, random_stage("noise"));
  Parts::Kept listed = kept_of(1), copied = kept_of(1);
  Table in_place(1), table(1);
  Parts::RowScratch here{}, there{};
  REQUIRE(Parts::distort(settings, random, steps, 0, 3, in_place.view(), here.rate.values, listed));
  REQUIRE(Parts::distort_copy(settings, random, steps, 0, 3, table.read(), there, copied));
  CHECK(table == Table(1));
  CHECK_FALSE(in_place == table);
  CHECK(std::equal(there.feature, there.feature + feature_dim, in_place.view().feature.row(3)));
  CHECK(std::equal(there.scaling, there.scaling + 6, in_place.view().scaling.row(3)));
  CHECK(std::equal(there.offset, there.offset + 3 * offsets, in_place.view().offset.row(3)));

  // The backward pass: what a listed row turns in place, an unlisted one adds to the arena's, where others have added
  // before.
  Table d_in_place(0), d_outside(2);
  const std::vector<double> rate(static_cast<std::size_t>(Parts::Attributes::row), 0.25);
  const std::array<double, 3> d_listed = Parts::pull_back(0, 3, rate.data(), d_in_place.view(), listed);
  const std::array<double, 3> d_copied = Parts::pull_back_copy(0, 3, rate.data(), d_outside.view(), there, copied);
  CHECK(d_listed == d_copied);
  Table expected(2);
  for (std::size_t c = 0; c < feature_dim; ++c) expected.view().feature(3, c) += d_in_place.view().feature(3, c);
  for (std::size_t c = 0; c < 6; ++c) expected.view().scaling(3, c) += d_in_place.view().scaling(3, c);
  for (std::size_t c = 0; c < 3 * offsets; ++c) expected.view().offset(3, c) += d_in_place.view().offset(3, c);
  CHECK(d_outside == expected);
  CHECK_FALSE(d_outside == Table(2));
}

TEST_CASE("rate/anchor_rate_model: an anchor with a NaN stays as it is, and has no steps to teach") {
  const AnchorRateSettings settings;
  const Random random(4, 9, random_stage("noise"));
  Parts::Kept kept = kept_of(1);
  Table table(1);
  table.view().scaling(2, 5) = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> feature = table.feature, offset = table.offset;
  CHECK_FALSE(Parts::distort(settings, random, steps, 0, 2, table.view(), nullptr, kept));
  CHECK(table.feature == feature);
  CHECK(table.offset == offset);
  Table d(1);
  CHECK(Parts::pull_back(0, 2, nullptr, d.view(), kept) == std::array<double, 3>{});
  CHECK(d == Table(1));
}

TEST_CASE("rate/anchor_rate_model: a share of the anchors teaches the steps what all of them would, in the mean") {
  constexpr std::size_t entries = 20000;
  const Random random(4, 9, random_stage("steps"));
  const auto sum_of = [&](double share, std::size_t& taught) {
    Parts::Kept kept = kept_of(entries);
    std::fill_n(kept.step.data(), 3 * entries, 0.05);
    double sum = 0;
    taught = 0;
    for (std::size_t e = 0; e < entries; ++e) {
      taught += Parts::pull_drawn_steps({}, share, random, e, static_cast<std::uint32_t>(e), {1, 1, 1}, kept) ? 1 : 0;
      sum += kept.d_step[3 * e];
    }
    return sum;
  };
  std::size_t all = 0, quarter = 0;
  const double whole = sum_of(1, all), drawn = sum_of(0.25, quarter);
  CHECK(all == entries);
  // Binomial: the count deviates by sqrt(n s (1 - s)) = 61, the sum by the same share, 1.2 %; five of them.
  CHECK(std::abs(static_cast<double>(quarter) - 5000) < 306);
  CHECK(std::abs(drawn / whole - 1) < 0.062);

  Parts::Kept kept = kept_of(1);
  std::fill_n(kept.step.data(), 3, 0.05);
  CHECK_FALSE(Parts::pull_drawn_steps({}, 1, random, 0, 0, {0, 0, 0}, kept));
  CHECK(Parts::pull_drawn_steps({}, 1, random, 0, 0, {0, std::numeric_limits<double>::quiet_NaN(), 0}, kept));
}

}  // namespace anchor_rate_model_test
