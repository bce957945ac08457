// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/picture_likeness.hpp"

#include <doctest/doctest.h>

#include <cmath>

#include "scene/register/register_scene.hpp"

using namespace compmark;
using testing::CloudRender;
using testing::SomePicture;

TEST_CASE("likeness does not mind tone, and is small for pictures of something else") {
  const CloudRender one(1, 500, 80, 60), other(2, 500, 80, 60);
  const SomePicture a = one.picture(one.camera()), b = other.picture(other.camera());
  SomePicture toned(a), flat(80, 60);
  for (float& value : toned.values) value = 0.1f + 0.6f * std::pow(value, 1.3f);
  CHECK(picture_likeness(a.view, a.view) == doctest::Approx(1));
  CHECK(picture_likeness(a.view, toned.view) > 0.97);
  CHECK(picture_likeness(a.view, toned.view) == picture_likeness(toned.view, a.view));
  CHECK(std::abs(picture_likeness(a.view, b.view)) < 0.2);
  for (float& value : flat.values) value = 0.4f;
  CHECK(picture_likeness(a.view, flat.view) == 0);
}
