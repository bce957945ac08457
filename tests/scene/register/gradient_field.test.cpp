// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/gradient_field.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {

ComplexField random_field(int left, int top, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("test/gradient_field"));
  std::vector<float> grey(40 * 30);
  for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<float>(random.uniform(i));
  return gradient_field(grey, {}, 40, 30, left, top);
}

}  // namespace

TEST_CASE("the correlation of two fields is the sum of inner products at the best shift") {
  ComplexField first = random_field(20, 30, 1), second = random_field(27, 25, 1), other = random_field(20, 30, 2);
  const ComplexField kept = first;
  const auto at = [](int x, int y) { return static_cast<std::size_t>(y) * field_side + static_cast<std::size_t>(x); };
  double direct = 0, square = 0;
  for (int y = 0; y < field_side - 10; ++y) {
    for (int x = 0; x < field_side - 10; ++x) {
      const std::size_t i = at(x, y), j = at((x + 7) % field_side, (y + field_side - 5) % field_side);
      direct += static_cast<double>(first.re[i] * second.re[j] + first.im[i] * second.im[j]);
      square += static_cast<double>(first.re[i] * first.re[i] + first.im[i] * first.im[i]);
    }
  }
  CHECK(square == doctest::Approx(1));
  FieldTransform transform;
  transform.forward(first);
  transform.forward(second);
  transform.forward(other);
  const FieldTransform::Peak peak = transform.peak(first, second);
  CHECK(peak.x == 7);
  CHECK(peak.y == -5);
  CHECK(peak.value == doctest::Approx(direct).epsilon(1e-4));
  CHECK(peak.value == doctest::Approx(1).epsilon(1e-4));
  CHECK(transform.peak(first, other).value < 0.3);
  transform.backward(first);  // with the axes in their places again
  for (std::size_t i = 0; i < kept.re.size(); i += 97)
    CHECK(first.re[i] / (field_side * field_side) == doctest::Approx(static_cast<double>(kept.re[i])).epsilon(1e-4));
}

TEST_CASE("a picture without an edge has a field of zeros") {
  const ComplexField field = gradient_field(std::vector<float>(40 * 30, 0.7f), {}, 40, 30, 10, 10);
  for (const float value : field.re) CHECK(value == 0);
}
