// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/camera_fit.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "compmark/core/thread_executor.hpp"
#include "scene/register/register_scene.hpp"

using namespace compmark;
using testing::CloudRender;
using testing::SomePicture;

namespace {

constexpr CameraStep some_step{.02, -.015, .03, .04, -.02, .05, .02, .8, -.6};

CameraFitSettings fit_settings() {
  CameraFitSettings settings;
  settings.steps = 40;
  settings.damping = 1e-5;
  return settings;
}

}  // namespace

TEST_CASE("a fit finds the camera of a render to a hundredth of a pixel, at any number of threads") {
  const CloudRender cloud(8, 800, 96, 72);
  const Camera<double> truth = moved(cloud.camera(), some_step);
  const SomePicture picture = cloud.picture(truth);
  SerialExecutor serial;
  ThreadExecutor threads(3);
  CHECK(CloudRender::apart(truth, cloud.camera()) > 2);
  const CameraFit fit = fit_camera(picture.view, cloud.camera(), fit_settings(), cloud, serial);
  CHECK(CloudRender::apart(truth, fit.camera) < 0.01);
  CHECK(fit.likeness > 0.999);
  const CameraFit same = fit_camera(picture.view, cloud.camera(), fit_settings(), cloud, threads);
  CHECK(same.camera.rotation_camera_world == fit.camera.rotation_camera_world);
  CHECK(same.camera.center_world == fit.camera.center_world);
}

TEST_CASE("a fit finds the camera of a picture in another tone, with noise and a fifth painted over") {
  const CloudRender cloud(9, 800, 96, 72);
  const Camera<double> truth = moved(cloud.camera(), some_step);
  SomePicture picture = cloud.picture(truth);
  const Random random(1, 0, random_stage("test/camera_fit"));
  const std::size_t plane = picture.view.plane_size();
  for (std::size_t i = 0; i < picture.values.size(); ++i)
    picture.values[i] = std::pow(0.9f * picture.values[i], 1.25f) + static_cast<float>(0.02 * random.normal(i));
  for (int y = 20; y < 52; ++y) {
    for (int x = 30; x < 73; ++x) {
      for (int c = 0; c < 3; ++c) picture.view(c, y, x) = c == 0 ? 1.0f : 0.0f;
    }
  }
  SerialExecutor serial;
  const CameraFit fit = fit_camera(picture.view, cloud.camera(), fit_settings(), cloud, serial);
  CHECK(CloudRender::apart(truth, fit.camera) < 0.5);
  const auto at = [&](int x, int y) { return fit.weight[static_cast<std::size_t>(y * 96 + x)]; };
  CHECK(at(50, 35) < 0.3);
  double outside = 0;
  for (std::size_t i = 0; i < 15 * 96; ++i) outside += static_cast<double>(fit.weight[i]) / (15 * 96);
  CHECK(outside > 0.7);
  // Negative control: where every difference counts whole the painted part pulls.
  CameraFitSettings plain = fit_settings();
  plain.least_scale = plain.most_scale = 100;
  const CameraFit pulled = fit_camera(picture.view, cloud.camera(), plain, cloud, serial);
  CHECK(CloudRender::apart(truth, pulled.camera) > 2 * CloudRender::apart(truth, fit.camera));
  CHECK(plane == fit.weight.size());
}

TEST_CASE("a step whose render fails is rejected, and only a start that cannot be drawn ends a fit") {
  const CloudRender cloud(8, 800, 96, 72);
  const Camera<double> truth = moved(cloud.camera(), some_step);
  const SomePicture picture = cloud.picture(truth);
  SerialExecutor serial;
  int calls = 0, fails_at = 2;
  const auto draw = [&](const Camera<double>& camera, ImageView<float> image, ImageView<float> tangents) {
    return ++calls != fails_at && cloud(camera, image, tangents);
  };
  const CameraFit fit = fit_camera(picture.view, cloud.camera(), fit_settings(), draw, serial);
  CHECK(calls > 3);
  CHECK(CloudRender::apart(truth, fit.camera) < 0.01);
  CHECK(fit.likeness > 0.999);
  calls = 0;
  fails_at = 1;
  const CameraFit none = fit_camera(picture.view, cloud.camera(), fit_settings(), draw, serial);
  CHECK(calls == 1);
  CHECK(none.weight.empty());
  // Steps that all fail leave the start, and an end.
  calls = 0;
  const auto once = [&](const Camera<double>& camera, ImageView<float> image, ImageView<float> tangents) {
    return ++calls == 1 && cloud(camera, image, tangents);
  };
  const CameraFit stayed = fit_camera(picture.view, cloud.camera(), fit_settings(), once, serial);
  CHECK(stayed.camera.center_world == cloud.camera().center_world);
  CHECK_FALSE(stayed.weight.empty());
  CHECK(calls < 15);
}
