// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Sightings for scene/probe.hpp: which camera sees which point, and where. They are COLMAP's features where the dataset
// has them, else projections of the points. Random points carry no information; for them the only point is the place
// that all cameras look at. Cost: reads the model once more.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "compmark/scene/colmap.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/random_points.hpp"

namespace compmark {
namespace detail {

struct Sighting {
  std::size_t view = 0, point = 0;
  double x = 0, y = 0;  ///< pixels of the photograph, turned, at the size of its file
};

struct Sightings {
  std::vector<std::array<double, 3>> points;
  std::vector<Sighting> list;  ///< by point
  bool are_features = false;   ///< found in the photographs, not projected
};

/// The point in the camera's frame.
[[nodiscard]] inline std::array<double, 3> to_camera(const Camera<double>& camera, const std::array<double, 3>& point) {
  std::array<double, 3> p{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      p[i] += camera.rotation_camera_world[3 * i + j] * (point[j] - camera.center_world[j]);
  }
  return p;
}

[[nodiscard]] inline Sightings features_of(const Dataset& dataset) {
  Sightings result;
  if (dataset.kind != "colmap") return result;
  const Result<ColmapModel> model = read_colmap_model(find_colmap_folder(dataset.root).path, {true});
  if (!model) return result;
  std::map<std::string, std::size_t> views;
  for (std::size_t i = 0; i < dataset.views.size(); ++i) views[dataset.views[i].name] = i;
  std::map<std::uint64_t, std::vector<Sighting>> tracks;
  for (const auto& [id, image] : model->images) {
    const auto view = views.find(image.name);
    const auto camera = model->cameras.find(image.camera_id);
    if (view == views.end() || camera == model->cameras.end()) continue;
    const View& v = dataset.views[view->second];
    const double sx = v.file_width / static_cast<double>(camera->second.width);
    const double sy = v.file_height / static_cast<double>(camera->second.height);
    for (const ColmapObservation& o : image.observations)
      tracks[o.point_id].push_back({view->second, 0, o.x * sx, o.y * sy});
  }
  // Points that the reader left out are no evidence either.
  const RobustBall ball = robust_ball(
      dataset.points.size(), [&](std::size_t i) -> const auto& { return dataset.points.position[i]; });
  PrecisePoints cameras;
  for (const View& view : dataset.views) cameras.position.push_back(view.camera.center_world);
  const double reach = dataset.points_are_random ? HUGE_VAL : ball.reach(median_distance(cameras, ball.center));
  for (const auto& [id, track] : tracks) {
    const auto point = model->points.find(id);
    if (point == model->points.end() || track.size() < 2) continue;
    const std::array<double, 3> position = place_in(dataset, point->second.position);
    if (!std::isfinite(position[0] + position[1] + position[2]) || ball.distance(position.data()) > reach) continue;
    for (Sighting sighting : track) {
      sighting.point = result.points.size();
      result.list.push_back(sighting);
    }
    result.points.push_back(position);
  }
  result.are_features = !result.list.empty();
  return result;
}

[[nodiscard]] inline Sightings find_sightings(const Dataset& dataset) {
  Sightings result = features_of(dataset);
  if (result.are_features) return result;
  result = {};
  if (dataset.points_are_random) {
    result.points.push_back(look_at(dataset).center);
  } else {
    const std::size_t step = 1 + dataset.points.size() / 5000;  // a sample is enough for quantiles
    for (std::size_t i = 0; i < dataset.points.size(); i += step) {
      const std::array<float, 3>& p = dataset.points.position[i];
      result.points.push_back({static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])});
    }
  }
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    for (std::size_t k = 0; k < dataset.views.size(); ++k) {
      const Camera<double>& camera = dataset.views[k].camera;
      const std::array<double, 3> p = to_camera(camera, result.points[i]);
      if (!(p[2] > 0)) continue;
      const double x = camera.fx * p[0] / p[2] + camera.cx, y = camera.fy * p[1] / p[2] + camera.cy;
      if (x >= 0 && y >= 0 && x <= camera.width && y <= camera.height) result.list.push_back({k, i, x, y});
    }
  }
  return result;
}

}  // namespace detail
}  // namespace compmark
