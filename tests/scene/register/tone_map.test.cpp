// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/tone_map.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "scene/register/register_scene.hpp"

using namespace compmark;
using testing::CloudRender;
using testing::SomePicture;

namespace {

std::array<double, 3> tone_color(const SomePicture& picture, std::size_t i) {
  const std::size_t plane = picture.view.plane_size();
  return {static_cast<double>(picture.values[i]), static_cast<double>(picture.values[plane + i]),
          static_cast<double>(picture.values[2 * plane + i])};
}
/// Root mean square of what a tone map leaves of the difference.
double tone_left(const ToneMap& tone, const SomePicture& from, const SomePicture& to) {
  const std::size_t plane = from.view.plane_size();
  double square = 0;
  for (std::size_t i = 0; i < plane; ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      square += std::pow(tone(c, tone_color(from, i)) - static_cast<double>(to.values[c * plane + i]), 2);
  }
  return std::sqrt(square / static_cast<double>(3 * plane));
}

}  // namespace

TEST_CASE("a tone map finds a matrix with an offset and a curve exactly, and a gamma to a hundredth") {
  const CloudRender cloud(4, 400, 64, 48);
  const SomePicture render = cloud.picture(cloud.camera());
  ThreadExecutor executor(2);
  SerialExecutor serial;
  const std::size_t plane = render.view.plane_size();
  const std::vector<float> weight(plane, 1.0f);
  ToneMap made;
  made.term = {{{.02, .5, .3, .1, .2, -.1}, {.01, .3, .4, .2, 0, .1}, {0, .1, .2, .6, .05, 0}}};
  SomePicture toned(render), gamma(render);
  for (std::size_t i = 0; i < plane; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      toned.values[c * plane + i] = static_cast<float>(made(c, tone_color(render, i)));
      gamma.values[c * plane + i] = std::pow(render.values[c * plane + i], 1.25f);
    }
  }
  const ToneMap found = fit_tone(render.view, toned.view, weight.data(), 1e-9, executor);
  CHECK(tone_left(found, render, toned) < 1e-4);
  CHECK(fit_tone(render.view, toned.view, weight.data(), 1e-9, serial).term == found.term);
  CHECK(tone_left(fit_tone(render.view, gamma.view, weight.data(), 1e-9, executor), render, gamma) < 0.01);
  CHECK(tone_left(ToneMap{}, render, gamma) > 0.02);  // negative control: without one
}

TEST_CASE("a tone map does not follow pixels without weight, and stays the identity where nothing is known") {
  const CloudRender cloud(5, 400, 64, 48);
  const SomePicture render = cloud.picture(cloud.camera());
  SomePicture painted(render);
  SerialExecutor serial;
  const std::size_t plane = render.view.plane_size();
  std::vector<float> weight(plane, 1.0f);
  for (std::size_t i = 0; i < plane / 3; ++i) {
    weight[i] = 0;
    for (std::size_t c = 0; c < 3; ++c) painted.values[c * plane + i] = 1;
  }
  CHECK(tone_left(fit_tone(render.view, painted.view, weight.data(), 1e-9, serial), render, render) < 1e-4);
  const std::vector<float> all(plane, 1.0f), none(plane, 0.0f);
  CHECK(tone_left(fit_tone(render.view, painted.view, all.data(), 1e-9, serial), render, render) > 0.05);
  CHECK(tone_left(fit_tone(render.view, painted.view, none.data(), 1e-9, serial), render, render) < 1e-6);
}
