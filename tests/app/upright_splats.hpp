// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A scene of splats with z up, as Blender has it, that looks different from every side: coloured boxes on a plate.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/math/spherical_harmonics.hpp>
#include <compmark/scene/splat_table.hpp>
#include <compmark/scene/views_around.hpp>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

namespace compmark::testing {

/// About `splats` opaque Gaussians of one colour each, on the faces of boxes within 1.2 of the origin.
inline SplatTable upright_splats(std::size_t splats, std::uint64_t seed = 1) {
  constexpr std::size_t boxes = 9;
  const Random random(seed, 0, random_stage("upright splats"));
  std::uint64_t n = 0;
  const auto between = [&](double low, double high) { return low + (high - low) * random.uniform(n++); };
  struct Box {
    std::array<double, 3> center, half, color;
  };
  std::vector<Box> all{{{0, 0, -0.55}, {1, 0.8, 0.06}, {0.35, 0.4, 0.3}}};
  while (all.size() < boxes) {
    Box box;
    box.half = {between(0.1, 0.35), between(0.1, 0.35), between(0.1, 0.45)};
    box.center = {between(-0.7, 0.7), between(-0.55, 0.55), -0.49 + box.half[2] + between(0, 0.3)};
    box.color = {between(0.1, 0.9), between(0.1, 0.9), between(0.1, 0.9)};
    all.push_back(box);
  }
  double area = 0;
  const auto faces = [](const Box& box) {
    return std::array<double, 3>{8 * box.half[1] * box.half[2], 8 * box.half[2] * box.half[0],
                                 8 * box.half[0] * box.half[1]};
  };
  for (const Box& box : all) area += faces(box)[0] + faces(box)[1] + faces(box)[2];
  SplatTable table;
  table.resize(splats, 0);
  const double spacing = std::sqrt(area / static_cast<double>(splats));
  double drawn = 0;
  std::size_t box = 0, row = 0;
  for (; row < splats; ++row) {
    const auto share = [&](const Box& of) { return (faces(of)[0] + faces(of)[1] + faces(of)[2]) / area; };
    while (box + 1 < all.size() && static_cast<double>(row) > (drawn + share(all[box])) * static_cast<double>(splats))
      drawn += share(all[box++]);
    const Box& of = all[box];
    const std::array<double, 3> size = faces(of);
    double at = between(0, size[0] + size[1] + size[2]);
    std::size_t axis = 0;
    while (axis < 2 && at > size[axis]) at -= size[axis++];
    std::array<double, 3> place{};
    for (std::size_t k = 0; k < 3; ++k) place[k] = of.half[k] * between(-1, 1);
    place[axis] = of.half[axis] * (between(-1, 1) < 0 ? -1 : 1);
    const bool dark = (static_cast<int>(std::floor(4 * place[0])) + static_cast<int>(std::floor(5 * place[1])) +
                       static_cast<int>(std::floor(6 * place[2]))) %
                          2 ==
                      0;
    for (std::size_t k = 0; k < 3; ++k) {
      table.mean[k][row] = static_cast<float>(of.center[k] + place[k]);
      table.log_scale[k][row] = static_cast<float>(std::log(k == axis ? 0.1 * spacing : 0.7 * spacing));
      const double color = of.color[k] * (dark ? 0.55 : 1) + between(-0.06, 0.06);
      table.color(k, 0)[row] = static_cast<float>((color - 0.5) / sh_constant);
    }
    table.rotation[0][row] = 1;
    table.opacity[row] = 5;
  }
  return table;
}

/// A camera that a photographer might take it with, from above: of `size` pixels a side.
inline Camera<double> upright_camera(double azimuth_degrees, double elevation_degrees, double distance, int size,
                                     const std::array<double, 3>& up = {0, 0, 1}) {
  const double degree = std::numbers::pi / 180;
  std::array<double, 3> place = direction_about(up, azimuth_degrees * degree, std::sin(elevation_degrees * degree));
  for (double& x : place) x *= distance;
  return camera_towards(place, {0.04, -0.03, -0.05}, up, {size, size, 40});
}

}  // namespace compmark::testing
