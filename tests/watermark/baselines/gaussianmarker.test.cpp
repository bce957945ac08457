// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/gaussianmarker.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

using namespace compmark;

TEST_CASE("baselines/gaussianmarker: of the anchors that are seen those with the least information are taken") {
  using Rows = std::vector<std::uint32_t>;
  const std::vector<double> information{3, 0, 0.5, 8, 0.25, 0, 2};
  CHECK(most_uncertain(information, 0.4) == Rows{2, 4});
  CHECK(most_uncertain(information, 0.6) == Rows{2, 4, 6});
  CHECK(most_uncertain(information, 1) == Rows{0, 2, 3, 4, 6});
  CHECK(most_uncertain(information, 0).empty());
  CHECK(most_uncertain(std::vector<double>{1, 1, 1, 1}, 0.5) == Rows{0, 1});  // of equals the first
  CHECK(most_uncertain(std::vector<double>{}, 0.5).empty());
}

TEST_CASE("baselines/gaussianmarker: networks are frozen, and the anchors' rates are the caller's") {
  TrainSettings given;
  given.feature = {0.003, 0.0003};
  const TrainSettings settings = gaussianmarker_settings(given);
  CHECK(settings.feature == given.feature);
  CHECK(settings.offset == given.offset);
  CHECK(settings.scaling == given.scaling);
  for (const LearningRate& rate : {settings.mlp_opacity, settings.mlp_covariance, settings.mlp_color})
    CHECK(rate == LearningRate{0, 0});
}
