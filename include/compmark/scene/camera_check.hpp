// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Warns of cameras that are most likely wrong. Poses that were inverted, or that have other axes, look past the scene;
// poses that were not filled in are all the same. Such a file is valid, but a training on it is wasted. Cost: at most
// 1,000 points are projected into every camera, about 10 us each.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include "compmark/scene/dataset.hpp"
#include "compmark/scene/repeated.hpp"

namespace compmark {
namespace detail {

/// Whether a point is in front of a camera and on its image. A lens bends rays, so half an image beside it counts too.
[[nodiscard]] inline bool may_see(const Camera<double>& camera, const std::array<float, 3>& place) {
  std::array<double, 3> p{};
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b)
      p[a] += camera.rotation_camera_world[3 * a + b] * (static_cast<double>(place[b]) - camera.center_world[b]);
  }
  if (!(p[2] > 0)) return false;
  return std::abs(camera.fx * p[0] / p[2] + camera.cx - camera.width / 2.0) <= camera.width &&
         std::abs(camera.fy * p[1] / p[2] + camera.cy - camera.height / 2.0) <= camera.height;
}

/// Warns if all cameras stand in one place, or if more than half of them see none of the points.
inline void say_strange_cameras(Dataset& dataset) {
  const auto say = [&](const std::string& sentence) {
    dataset.warnings.push_back(dataset.root.string() + ": " + sentence);
  };
  const std::size_t n = dataset.views.size();
  if (n < 4) return;  // too few for a judgement
  const Camera<double>& first = dataset.views[0].camera;
  const auto all = [&](const auto& test) { return std::all_of(dataset.views.begin(), dataset.views.end(), test); };
  if (all([&](const View& view) { return same_pose(view.camera, first); })) {
    say("all " + std::to_string(n) + " photographs have the same pose, so that depth cannot be estimated");
    return;
  }
  if (all([&](const View& view) { return view.camera.center_world == first.center_world; }))
    say("all " + std::to_string(n) + " cameras stand in one place, so that depth cannot be estimated");
  if (dataset.points_are_random || dataset.points.size() == 0) return;
  const std::size_t step = 1 + (dataset.points.size() - 1) / 1000;
  const auto blind =
      static_cast<std::size_t>(std::count_if(dataset.views.begin(), dataset.views.end(), [&](const View& view) {
        for (std::size_t i = 0; i < dataset.points.size(); i += step) {
          if (may_see(view.camera, dataset.points.position[i])) return false;
        }
        return true;
      }));
  if (2 * blind > n) {
    say(std::to_string(blind) + " of " + std::to_string(n) +
        " cameras see none of the points: their poses may be inverted, or have other axes");
  }
}

}  // namespace detail
}  // namespace compmark
