// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/camera_search.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "scene/register/register_scene.hpp"

using namespace compmark;
using testing::CloudRender;
using testing::SomePicture;

TEST_CASE("a search finds the place of a picture that was cut out, enlarged and turned") {
  const CloudRender cloud(3, 500, 96, 72);
  FieldTransform transform;
  std::vector<SearchPlace> places;
  for (int k = 0; k < 7; ++k) {
    const double angle = 0.35 * (k - 3);
    const Camera<double> camera =
        moved(cloud.camera(), {0, angle, 0, -5 * std::sin(angle), 0, 5 - 5 * std::cos(angle), 0, 0, 0});
    places.push_back(search_place(camera, cloud.picture(search_camera(camera)).view, transform));
  }
  ThreadExecutor threads(2);
  SerialExecutor serial;
  for (const std::size_t place : {1u, 3u, 4u}) {
    // Turned by 15 degrees and seen through a window of 0.7 of the picture.
    Camera<double> truth =
        moved(places[place].camera, {0, 0, -15 * std::numbers::pi / 180, 0, 0, 0, -std::log(.7), 2, -1});
    truth = truth.resized(120, 90);
    const SomePicture picture = cloud.picture(truth);
    const std::vector<SearchMatch> found = search_cameras(places, picture.view, SearchSettings{}, 3, threads);
    REQUIRE(found.size() == 3);
    CHECK(found[0].place == place);
    CHECK(found[0].camera.width == 120);
    CHECK(CloudRender::apart(truth, found[0].camera) < 10);
    CHECK(CloudRender::apart(truth, found[1].camera) > 10);  // negative control: another place
    CHECK(search_cameras(places, picture.view, SearchSettings{}, 3, serial)[0].likeness == found[0].likeness);
  }
}
