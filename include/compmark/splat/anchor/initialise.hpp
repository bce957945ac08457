// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// First anchors from a point cloud (docs/spec/method.md, 1.2): one anchor at the centre of every occupied voxel, all
// six log scales the root mean square distance to the three nearest other anchors. Neighbours are exact (nanoflann).
// Four deliberate differences from the published code (docs/spec/method.md, 7.17; docs/spec/numerics.md, AN1 to AN4):
//   automatic voxel size  the square root is taken, so that it is a length (published: a squared length;
//                         `auto_voxel_squared` restores it)
//   AN1, AN3              cells are rounded half to even in double and compared as three integers, so that far cells
//                         neither merge nor tear
//   AN2                   the automatic size never falls below 1e-6 of the cloud's extent: duplicated points give one
//                         anchor, not none
//   AN4                   the squared distance is at least voxel^2 / 10; at the published voxel of 0.001 that is the
//                         published 1e-7
// Of an unbounded scene (ContractedSpace) the voxels are cubes of contracted space; without one, they are as they were,
// to the bit. Cost: O(n log n); about 1 microsecond a point.
#pragma once

#include <nanoflann.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/splat/anchor/cells.hpp"
#include "compmark/splat/anchor/space.hpp"

namespace compmark {

struct InitialiseSettings {
  double voxel_size =
      0.001;  ///< world units; 0 or less: the median over points of the root mean square distance to 3 neighbours
  bool auto_voxel_squared =
      false;  ///< the published automatic size: the mean squared distance itself, a length only by accident
  /// World units, in the cells of a stretched space: no scale is greater. A point that stands alone has the distance of
  /// the others as its scale, and one such Gaussian owns the volume loss.
  double greatest_scale = std::numeric_limits<double>::infinity();
};

/// Anchors sorted by voxel (x, then y, then z). Offsets and features start at zero and are not listed.
template <class T>
struct InitialAnchors {
  std::vector<T> position;         ///< [N, 3]
  std::vector<T> scaling;          ///< [N, 6] log
  double voxel_size = 0;           ///< the size used
  std::size_t skipped_points = 0;  ///< points with a NaN or infinity, or more than 2^31 voxels away
  [[nodiscard]] std::size_t count() const { return position.size() / 3; }
};

namespace detail {

/// nanoflann's view of a list of points.
struct PointList {
  std::vector<std::array<double, 3>> points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t index, std::size_t axis) const { return points[index][axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

/// Mean squared distance of every point to its three nearest others (fewer where there are fewer; 0 for a point alone).
/// The point itself is excluded by index, so that duplicates count as distance 0.
[[nodiscard]] inline std::vector<double> mean_squared_neighbour_distance(const PointList& list) {
  using Tree =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointList, double, std::uint32_t>,
                                          PointList, 3, std::uint32_t>;
  const std::size_t n = list.points.size();
  std::vector<double> result(n, 0.0);
  if (n < 2) return result;
  const Tree tree(3, list, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  for (std::size_t i = 0; i < n; ++i) {
    std::array<std::uint32_t, 4> index{};
    std::array<double, 4> squared{};
    const std::size_t found = tree.knnSearch(list.points[i].data(), 4, index.data(), squared.data());
    std::size_t self = found - 1;  // four or more duplicates may crowd it out: then the last of them stands for it
    for (std::size_t j = 0; j < found; ++j) {
      if (index[j] == i) self = j;
    }
    double sum = 0;
    for (std::size_t j = 0; j < found; ++j) sum += j == self ? 0.0 : squared[j];
    result[i] = sum / static_cast<double>(found - 1);
  }
  return result;
}

}  // namespace detail

/// The automatic voxel size of a cloud of finite points.
[[nodiscard]] inline double automatic_voxel_size(const detail::PointList& cloud, bool squared) {
  std::vector<double> distance = detail::mean_squared_neighbour_distance(cloud);
  const std::size_t middle =
      std::max<std::size_t>(distance.size() / 2, 1) - 1;  // the floor(n / 2)-th smallest, counted from one
  std::nth_element(distance.begin(), distance.begin() + static_cast<std::ptrdiff_t>(middle), distance.end());
  const double size = squared ? distance[middle] : std::sqrt(distance[middle]);
  double extent = 0, magnitude = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double low = cloud.points[0][axis], high = low;
    for (const auto& point : cloud.points) {
      low = std::min(low, point[axis]);
      high = std::max(high, point[axis]);
    }
    extent = std::max(extent, high - low);
    magnitude = std::max({magnitude, std::abs(low), std::abs(high)});
  }
  const double least =
      std::max(1e-6 * extent, 1e-9 * magnitude);  // the second: far from the origin, cells must fit 32 bits
  return std::max({size, least, 1e-12});
}

template <class T = float, Space S = EuclideanSpace>
[[nodiscard]] Result<InitialAnchors<T>> initial_anchors(std::span<const std::array<float, 3>> points,
                                                        const InitialiseSettings& settings, const S& space = {}) {
  InitialAnchors<T> anchors;
  if constexpr (present<S>) {
    if (!space.valid()) {
      return Error{ErrorKind::invalid,
                   {},
                   "space_radius",
                   "is not a positive length, which cells of contracted space need",
                   "give the ball of the cameras (scene/far_field.hpp) to the settings"};
    }
  }
  if (points.empty()) {
    return Error{
        ErrorKind::invalid, {}, "points", "the point cloud is empty", "give a scene with a point cloud, or sample one"};
  }
  detail::PointList cloud;
  cloud.points.reserve(points.size());
  for (const std::array<float, 3>& point : points) {
    if (!std::isfinite(point[0]) || !std::isfinite(point[1]) || !std::isfinite(point[2])) {
      ++anchors.skipped_points;
      continue;
    }
    cloud.points.push_back(
        {static_cast<double>(point[0]), static_cast<double>(point[1]), static_cast<double>(point[2])});
  }
  if (cloud.points.empty()) {
    return Error{
        ErrorKind::invalid, {}, "points", "no point of the cloud is finite", "repair or re-export the point cloud"};
  }
  if (settings.voxel_size > 0) {
    anchors.voxel_size = settings.voxel_size;
  } else if constexpr (present<S>) {
    detail::PointList contracted;
    for (const std::array<double, 3>& point : cloud.points) contracted.points.push_back(space.contract(point.data()));
    anchors.voxel_size = automatic_voxel_size(contracted, settings.auto_voxel_squared);
  } else {
    anchors.voxel_size = automatic_voxel_size(cloud, settings.auto_voxel_squared);
  }
  if (!std::isfinite(anchors.voxel_size)) {
    return Error{
        ErrorKind::invalid, {}, "voxel_size", "the voxel size is not finite", "give a positive length in world units"};
  }

  std::vector<Cell> cells;
  cells.reserve(cloud.points.size());
  for (const std::array<double, 3>& point : cloud.points) {
    Cell cell;
    if (space.cell_of(point.data(), anchors.voxel_size, cell)) {
      cells.push_back(cell);
    } else {
      ++anchors.skipped_points;
    }
  }
  if (cells.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 "voxel_size",
                 "every point is more than 2^31 voxels of " + std::to_string(anchors.voxel_size) + " away",
                 "give a larger voxel size"};
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());

  detail::PointList centers;
  centers.points.reserve(cells.size());
  anchors.position.reserve(3 * cells.size());
  for (const Cell& cell : cells) {
    const std::array<double, 3> center = space.center(cell, anchors.voxel_size);
    centers.points.push_back(center);
    for (const double x : center) anchors.position.push_back(static_cast<T>(x));
  }
  anchors.scaling.reserve(6 * cells.size());
  const std::vector<double> distance = detail::mean_squared_neighbour_distance(centers);
  for (std::size_t i = 0; i < distance.size(); ++i) {
    const double stretch = space.stretch(centers.points[i].data()), voxel = anchors.voxel_size * stretch;
    const double greatest = settings.greatest_scale * stretch;
    const double alone = distance.size() == 1 ? voxel * voxel : std::max(distance[i], 0.1 * voxel * voxel);
    const double used = std::min(alone, greatest * greatest);
    anchors.scaling.insert(anchors.scaling.end(), 6, static_cast<T>(0.5 * std::log(used)));
  }
  return anchors;
}

}  // namespace compmark
