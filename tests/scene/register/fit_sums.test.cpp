// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/fit_sums.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "compmark/core/thread_executor.hpp"
#include "scene/register/register_scene.hpp"

using namespace compmark;
using testing::CloudRender;
using testing::SomePicture;

TEST_CASE("the right side of a fit is the derivative of its cost by every number of the camera") {
  const CloudRender cloud(6, 300, 61, 45);
  const Camera<double> camera = cloud.camera();
  const SomePicture picture = cloud.picture(moved(camera, {.01, -.008, .02, .02, 0, .03, .01, .5, -.4}));
  ToneMap tone;
  tone.term[0] = {.02, .8, .1, 0, .05, 0};
  ThreadExecutor threads(3);
  SerialExecutor serial;
  detail::FitRoom room;
  room.resize(61, 45);
  const auto sums = [&](const Camera<double>& at, auto& executor) {
    cloud(at, room.view, room.planes);
    return detail::fit_sums<true>(room, picture.view, tone, 0.1, executor);
  };
  const detail::FitSums here = sums(camera, serial), many = sums(camera, threads);
  CHECK(here.g == many.g);
  CHECK(here.h == many.h);
  for (std::size_t p = 0; p < camera_parameters; ++p) {
    const double h = p < 7 ? 1e-3 : 1e-1;  // images are in float
    CameraStep step{};
    step[p] = h;
    const double above = sums(moved(camera, step), serial).cost;
    step[p] = -h;
    const double below = sums(moved(camera, step), serial).cost;
    const double expected = (above - below) / (2 * h), found = here.g[p] * 2 / 3;
    CHECK(found == doctest::Approx(expected).epsilon(0.05));
    CHECK(here.h[packed_index(p, p)] > 0);
  }
}

TEST_CASE("the deviation of a fit is of the noise, not of what is painted over") {
  const CloudRender cloud(7, 600, 80, 60);
  SomePicture picture = cloud.picture(cloud.camera());
  const Random random(1, 0, random_stage("test/fit_deviation"));
  const std::size_t plane = picture.view.plane_size();
  for (std::size_t i = 0; i < picture.values.size(); ++i)
    picture.values[i] += static_cast<float>(0.02 * random.normal(i));
  for (std::size_t i = 0; i < plane / 5; ++i) picture.values[i] = 1;
  SerialExecutor serial;
  detail::FitRoom room;
  room.resize(80, 60);
  cloud(cloud.camera(), room.view, room.planes);
  detail::fit_errors(room, picture.view, ToneMap{}, serial);
  const double deviation = detail::fit_deviation(room);
  CHECK(deviation > 0.02);
  CHECK(deviation < 0.05);
}
