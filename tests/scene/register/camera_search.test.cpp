// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/camera_search.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>
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

TEST_CASE("a search is not half a pixel of its field beside, whether its renders have even sides or odd ones") {
  ThreadExecutor threads(2);
  for (const int height : {72, 54}) {  // a field of 48 x 36, and of 48 x 27
    CAPTURE(height);
    const CloudRender cloud(3, 500, 96, height);
    FieldTransform transform;
    const Camera<double> camera = cloud.camera();
    const std::vector<SearchPlace> places{search_place(camera, cloud.picture(search_camera(camera)).view, transform)};
    // Shifts are whole pixels of the field, two of the picture's, so that one search errs by a pixel at most; over
    // shifts of the picture by fractions of that the mean error says where the field lies. Half a pixel beside, which
    // odd sides were before, is a pixel in the mean.
    double mean = 0;
    constexpr int shifts = 16;
    for (int k = 0; k < shifts; ++k) {
      Camera<double> shifted = camera;
      shifted.cy += 0.25 * (k + 0.5) - 2;
      const std::vector<SearchMatch> found =
          search_cameras(places, cloud.picture(shifted).view, SearchSettings{}, 1, threads);
      REQUIRE(found.size() == 1);
      mean += (found[0].camera.cy - shifted.cy) / shifts;
    }
    CHECK(std::abs(mean) < 0.5);
  }
}

TEST_CASE("a picture without an edge, or of what is no number, is like no place") {
  const CloudRender cloud(3, 500, 96, 72);
  FieldTransform transform;
  const std::vector<SearchPlace> places{
      search_place(cloud.camera(), cloud.picture(search_camera(cloud.camera())).view, transform)};
  ThreadExecutor threads(2);
  for (const float color : {0.0f, 0.5f, NAN}) {
    for (const auto& [width, height] : {std::pair(63, 51), std::pair(100, 80), std::pair(64, 64)}) {
      const std::vector<float> flat(static_cast<std::size_t>(3 * width * height), color);
      const ImageView<const float> view{flat.data(), 3, height, width};
      CHECK(search_cameras(places, view, SearchSettings{}, 3, threads).empty());
    }
  }
}
