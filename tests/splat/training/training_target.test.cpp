// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/training/training_target.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <string>

#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/scaffold.hpp"

using namespace compmark;

namespace {

/// Colour i of the photograph is i, coverage and weight count down; view 1 cannot be read.
struct CountingViews {
  Camera<double> seen;
  std::array<float, 3> behind{-1, -1, -1};
  bool asked_for_alpha = false, asked_for_weight = false, asked_for_planes = false;

  [[nodiscard]] std::size_t size() const { return 2; }
  [[nodiscard]] Camera<double> camera(std::size_t /*i*/) const { return seen; }
  Result<Done> load(std::size_t i, ImageView<float> image) {
    if (i == 1) return Error{ErrorKind::invalid, "b.png", "size", "is of another world", "take it away"};
    for (std::size_t k = 0; k < image.size(); ++k) image.data[k] = static_cast<float>(k);
    return Done{};
  }
  Result<Done> load_planes(std::size_t i, std::array<float, 3> background, TargetPlanes<float> planes) {
    asked_for_planes = true;
    asked_for_alpha = planes.alpha != nullptr;
    asked_for_weight = planes.weight != nullptr;
    behind = background;
    for (std::size_t k = 0; k < planes.image.plane_size(); ++k) {
      if (planes.alpha != nullptr) planes.alpha[k] = -static_cast<float>(k);
      if (planes.weight != nullptr) planes.weight[k] = -2 * static_cast<float>(k);
    }
    return load(i, planes.image);
  }
};

CountingViews small_views() {
  CountingViews views;
  views.seen.width = 5;
  views.seen.height = 3;
  return views;
}

}  // namespace

TEST_CASE("training/training_target: a recipe without effects loads colours alone, and has no planes") {
  CountingViews views = small_views();
  TrainingTarget<recipes::Scaffold> target;
  REQUIRE(target.load(views, 0, views.seen, {0.1f, 0.2f, 0.3f}));
  CHECK_FALSE(views.asked_for_planes);
  CHECK(target.image().channels == 3);
  CHECK(target.image().height == 3);
  CHECK(target.image().width == 5);
  CHECK(target.image().data[44] == 44);
  CHECK(target.weight().empty());
  CHECK(target.view().alpha == nullptr);
  CHECK(target.view().weight == nullptr);
  CHECK(sizeof(TrainingTarget<recipes::Scaffold>) < sizeof(TrainingTarget<recipes::ScaffoldMasked>));
}

TEST_CASE("training/training_target: each effect has the plane that it looks at, and no other") {
  CountingViews views = small_views();
  TrainingTarget<recipes::ScaffoldMasked> masked;
  REQUIRE(masked.load(views, 0, views.seen, {0, 0, 0}));
  CHECK(views.asked_for_weight);
  CHECK_FALSE(views.asked_for_alpha);
  REQUIRE(masked.weight().size() == 15);
  CHECK(masked.weight()[14] == -28);
  CHECK(masked.view().weight == masked.weight().data());
  CHECK(masked.view().alpha == nullptr);

  TrainingTarget<recipes::ScaffoldAlpha> covered;
  REQUIRE(covered.load(views, 0, views.seen, {0.1f, 0.2f, 0.3f}));
  CHECK(views.asked_for_alpha);
  CHECK_FALSE(views.asked_for_weight);
  CHECK(views.behind == std::array{0.1f, 0.2f, 0.3f});
  REQUIRE(covered.view().alpha != nullptr);
  CHECK(covered.view().alpha[14] == -14);
  CHECK(covered.weight().empty());
}

TEST_CASE("training/training_target: views of other sizes follow each other, and what cannot be read is said") {
  CountingViews views = small_views();
  TrainingTarget<recipes::ScaffoldMasked> target;
  REQUIRE(target.load(views, 0, views.seen, {0, 0, 0}));
  views.seen.width = 2;
  REQUIRE(target.load(views, 0, views.seen, {0, 0, 0}));
  CHECK(target.image().width == 2);
  CHECK(target.weight().size() == 6);
  const Result<Done> broken = target.load(views, 1, views.seen, {0, 0, 0});
  REQUIRE_FALSE(broken);
  CHECK(broken.error().line().find("b.png") != std::string::npos);
}
