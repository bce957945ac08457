// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/anchor/missing_share.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>

#include "compmark/core/gaussians.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

template <class T>
GaussianBatch<T> thinned_gaussians(std::size_t count) {
  GaussianBatch<T> batch;
  batch.resize(count);
  const GaussianColumns<T> columns = batch.columns();
  const Random random(5, 0, 0);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      columns.mean[axis][p] = columns.color[axis][p] = static_cast<T>(random.uniform(100 * axis + p));
      columns.scale[axis][p] = static_cast<T>(0.01 + 0.1 * random.uniform(1000 + 100 * axis + p));
    }
    columns.opacity[p] = static_cast<T>(0.98 * random.uniform(2000 + p));
  }
  columns.opacity[0] = T(-0.25);  // not drawn
  columns.opacity[1] = T(0);
  return batch;
}

}  // namespace

TEST_CASE("anchor/missing_share: what is left covers the area and the depth of what was there") {
  GaussianBatch<double> whole = thinned_gaussians<double>(30), left = thinned_gaussians<double>(30);
  const GaussianColumns<double> before = whole.columns(), after = left.columns();
  make_up_for_missing(after, 0);
  for (std::size_t p = 0; p < 30; ++p) REQUIRE(after.opacity[p] == before.opacity[p]);
  make_up_for_missing(after, 0.36);
  for (std::size_t p = 0; p < 30; ++p) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      CHECK(after.scale[axis][p] == doctest::Approx(before.scale[axis][p] / 0.8).epsilon(1e-14));
      CHECK(after.mean[axis][p] == before.mean[axis][p]);
      CHECK(after.color[axis][p] == before.color[axis][p]);
    }
    if (p < 2) {
      CHECK(after.opacity[p] == before.opacity[p]);
      continue;
    }
    // Optical depths: .64 of the Gaussians, each as deep as 1 / .64 of itself.
    CHECK(0.64 * std::log1p(-after.opacity[p]) == doctest::Approx(std::log1p(-before.opacity[p])).epsilon(1e-13));
  }
  // An opacity of one stays: there is no logarithm of nothing.
  after.opacity[2] = 1;
  make_up_for_missing(after, 0.5);
  CHECK(after.opacity[2] == 1);
}

TEST_CASE("anchor/missing_share: small opacities keep their bits in float, which 1 - opacity loses") {
  GaussianBatch<float> batch = thinned_gaussians<float>(3);
  const GaussianColumns<float> columns = batch.columns();
  columns.opacity[2] = 3e-7f;
  make_up_for_missing(columns, 0.5);
  CHECK(columns.opacity[2] == doctest::Approx(6e-7).epsilon(1e-6));
  const float naive = 1 - std::pow(1 - 3e-7f, 2.0f);
  CHECK(std::abs(naive - 6e-7f) > 1e-9f);  // the control: 1 - opacity has 24 bits
}
