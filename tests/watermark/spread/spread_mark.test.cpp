// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/scene/camera.hpp>
#include <compmark/watermark/spread/spread_mark.hpp>
#include <cstddef>
#include <numeric>
#include <set>
#include <vector>

namespace spread_mark_test {
namespace {

using namespace compmark;

OwnerKey key_of(int number) {
  Digest256 secret{};
  secret[0] = static_cast<std::byte>(number);
  return *make_key(secret, "2026-01-31T23:59:59Z", 48);
}

struct Anchors {
  std::vector<float> position;
  explicit Anchors(std::size_t count, double extent = 4) {
    const Random random(5, 0, random_stage("test/spread"));
    for (std::size_t i = 0; i < 3 * count; ++i)
      position.push_back(static_cast<float>(extent * (random.uniform(i) - 0.5)));
  }
  [[nodiscard]] MatrixView<const float> view() const { return {position.data(), position.size() / 3, 3}; }
};

}  // namespace

TEST_CASE("watermark/spread: cells are cubes, and anchors of a cube have one sign") {
  const Anchors anchors(3000);
  const SpreadCells cells = spread_cells(anchors.view(), 0.5);
  CHECK(cells.of_anchor.size() == 3000);
  CHECK(cells.place.size() <= 512);
  CHECK(cells.place.size() > 450);
  CHECK(std::set<std::array<std::int64_t, 3>>(cells.place.begin(), cells.place.end()).size() == cells.place.size());
  for (std::size_t a = 0; a < 3000; ++a) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double inside = anchors.view()(a, k) - 0.5 * static_cast<double>(cells.place[cells.of_anchor[a]][k]);
      CHECK((inside >= 0 && inside < 0.5));
    }
  }
  // Anything a file may say is a cell.
  const std::array<float, 6> far{1e38f, -1e38f, 0, 3e-39f, -0.0f, 7};
  CHECK(spread_cells({far.data(), 2, 3}, 1e-30).place.size() == 2);
}

TEST_CASE("watermark/spread: signs follow from key and place alone, are fair, and tell keys apart") {
  const Anchors anchors(20000, 40);
  const SpreadCells cells = spread_cells(anchors.view(), 1);
  const std::vector<std::int8_t> one = spread_signs(key_of(1), cells), two = spread_signs(key_of(2), cells);
  const double count = static_cast<double>(one.size());
  CHECK(count > 10000);
  double sum = 0, both = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    CHECK((one[i] == 1 || one[i] == -1));
    sum += one[i];
    both += one[i] * two[i];
  }
  CHECK(std::abs(sum) < 4 * std::sqrt(count));  // four deviations of fair coins
  CHECK(std::abs(both) < 4 * std::sqrt(count));
  // Other anchors in the same cube: the same sign.
  SpreadCells other;
  other.place = {cells.place[17], cells.place[3]};
  CHECK(spread_signs(key_of(1), other) == std::vector<std::int8_t>{one[17], one[3]});
}

TEST_CASE("watermark/spread: a cube's side is what covers so many pixels in the median") {
  // All anchors at one point, 8 in front of cameras of focal length 200: a pixel is 0.04.
  std::vector<float> position(300, 0.0f);
  for (std::size_t i = 0; i < 100; ++i) position[3 * i + 2] = 8;
  Camera<double> camera;
  camera.fx = camera.fy = 200;
  const auto cameras = [&](std::size_t) -> const Camera<double>& { return camera; };
  CHECK(spread_side({position.data(), 100, 3}, cameras, 5, 10) == doctest::Approx(0.4));
  CHECK(spread_side({position.data(), 0, 3}, cameras, 5, 10) == 0);
  CHECK(spread_side({position.data(), 100, 3}, cameras, 0, 10) == 0);
}

TEST_CASE("watermark/spread: what is added is what is read: sums are strength x sign x anchors of a cell") {
  const Anchors anchors(400);
  const SpreadCells cells = spread_cells(anchors.view(), 1);
  const std::vector<std::int8_t> signs = spread_signs(key_of(3), cells);
  const Random random(6, 0, random_stage("test/spread"));
  std::vector<float> direction(400 * 8), feature(400 * 8, 0.25f);
  for (std::size_t i = 0; i < direction.size(); ++i) direction[i] = static_cast<float>(random.normal(i));
  for (std::size_t f = 0; f < 8; ++f) direction[8 * 7 + f] = 0;  // an anchor that no view saw
  normalise_rows({direction.data(), 400, 8});
  const MatrixView<const float> along{direction.data(), 400, 8};
  add_spread({feature.data(), 400, 8}, along, cells, signs, 0.5);
  for (float& value : feature) value -= 0.25f;
  std::vector<double> sums(cells.place.size(), 0);
  add_spread_sums({feature.data(), 400, 8}, along, cells, sums);
  std::vector<double> expected(cells.place.size(), 0);
  for (std::size_t a = 0; a < 400; ++a)
    if (a != 7) expected[cells.of_anchor[a]] += 0.5 * signs[cells.of_anchor[a]];
  for (std::size_t c = 0; c < sums.size(); ++c) CHECK(sums[c] == doctest::Approx(expected[c]).epsilon(1e-5));
}

}  // namespace spread_mark_test
