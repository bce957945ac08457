// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Space of an unbounded scene: the contraction of mip-NeRF 360 (arXiv 2111.12077, equation 10) about the cameras,
//   c(x) = x where |x| <= 1, (2 - 1 / |x|) x / |x| beyond,
// in units of the cameras' radius about their centre. Cells are cubes of contracted space: inside the ball they are the
// cells of the world, to the bit; at r radii they are r / (2 - 1 / r) times as wide across the line of sight and r^2
// times as long along it, so that they look about as large from the cameras wherever they are, and there are 8 (radius
// / size)^3 at most, however far the scene goes. Anchors are born as wide as their cell is across, not as long: cameras
// inside the ball hardly see the depth, and see a long Gaussian from the side as a streak. Points beyond 1,000 radii
// count as 1,000 radii away where cells have to be given a place (Jacobian 1e-6: docs/spec/effects.md, 4). Cost: a
// square root and a division for a point outside the ball, at initialisation and at each adjustment of the anchors.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "compmark/splat/anchor/cells.hpp"
#include "compmark/splat/anchor/space.hpp"

namespace compmark {

struct ContractedSpace {
  std::array<double, 3> origin{0, 0, 0};  ///< centre of the cameras
  double radius = 1;                      ///< of the ball in which nothing changes; above 0

  static constexpr double farthest = 1000;  ///< radii

  [[nodiscard]] bool valid() const {
    return radius > 0 && std::isfinite(radius) && std::isfinite(origin[0]) && std::isfinite(origin[1]) &&
           std::isfinite(origin[2]);
  }

  /// The world into the ball of two radii.
  template <class T>
  [[nodiscard]] std::array<double, 3> contract(const T* position) const {
    const std::array<double, 3> point{static_cast<double>(position[0]), static_cast<double>(position[1]),
                                      static_cast<double>(position[2])};
    const double r = radii(point);
    return r > 1 ? scaled(point, (2 - 1 / r) / r) : point;
  }
  /// Its inverse. What lies at two radii or beyond comes from `limit` radii of contracted space.
  [[nodiscard]] std::array<double, 3> expand(const std::array<double, 3>& contracted,
                                             double limit = 2 - 1 / farthest) const {
    const double s = radii(contracted);
    return s > 1 ? scaled(contracted, 1 / (s * (2 - std::min(s, limit)))) : contracted;
  }

  template <class T>
  [[nodiscard]] bool cell_of(const T* position, double size, Cell& cell) const {
    return compmark::cell_of(contract(position).data(), size, cell);
  }
  /// A cell on the rim of contracted space, whose centre is no point of the world, is given a place half a cell
  /// inwards.
  [[nodiscard]] std::array<double, 3> center(const Cell& cell, double size) const {
    return expand(EuclideanSpace::center(cell, size), rim(size));
  }
  [[nodiscard]] bool in_range(const Cell& cell, double size) const {
    return radii(EuclideanSpace::center(cell, size)) <= rim(size);
  }
  template <class T>
  [[nodiscard]] double stretch(const T* position) const {
    const double r = std::min(
        radii({static_cast<double>(position[0]), static_cast<double>(position[1]), static_cast<double>(position[2])}),
        farthest);
    return r > 1 ? r / (2 - 1 / r) : 1;
  }

 private:
  [[nodiscard]] double radii(const std::array<double, 3>& p) const {
    return std::hypot(p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]) / radius;
  }
  [[nodiscard]] std::array<double, 3> scaled(const std::array<double, 3>& p, double factor) const {
    return {origin[0] + (p[0] - origin[0]) * factor, origin[1] + (p[1] - origin[1]) * factor,
            origin[2] + (p[2] - origin[2]) * factor};
  }
  [[nodiscard]] double rim(double size) const { return std::max(1.0, 2 - std::max(0.5 * size / radius, 1 / farthest)); }
};
static_assert(Space<ContractedSpace>);

}  // namespace compmark
