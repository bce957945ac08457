// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A small model and cameras around it, shared by the tests of baking.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/training/model.hpp"

namespace compmark::testing {

using BakeRecipe = recipes::Scaffold;

/// `rows` anchors in a ball of radius 1 with random features and untrained networks, whose weights are `gain` times the usual; the columns
/// that see the view direction are multiplied by `view_gain`: 0 makes a model that looks the same from everywhere.
inline Model<BakeRecipe> bake_model(std::size_t rows, double gain, double view_gain) {
  Model<BakeRecipe> model;
  model.create(rows, 1);
  const Random random(11, 0, random_stage("bake test"));
  const AnchorColumns<float> anchors = anchor_values(model.arena, model.anchors);
  for (std::size_t i = 0; i < rows; ++i) {
    const std::uint64_t key = 256 * i;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      anchors.position(i, axis) = static_cast<float>(1.2 * (random.uniform(key + axis) - 0.5));
    }
    for (std::size_t c = 0; c < anchors.offset.columns; ++c)
      anchors.offset(i, c) = static_cast<float>(random.normal(key + 10 + c));
    for (std::size_t c = 0; c < 6; ++c)
      anchors.scaling(i, c) = static_cast<float>(std::log(0.1) + 0.3 * random.normal(key + 50 + c));
    for (std::size_t c = 0; c < anchors.feature.columns; ++c) {
      anchors.feature(i, c) = static_cast<float>(random.normal(key + 60 + c));
    }
  }
  BakeRecipe::GaussianDecoder::initialise(model.arena, model.decoder, 3);
  for (const ArenaLayout::Block& block : model.arena.layout().blocks()) {
    if (block.kind != RowKind::fixed) continue;
    const MatrixView<float> values = model.arena.values(model.arena.layout().find(block.name));
    for (float& value : values.flat()) value *= static_cast<float>(gain);
    if (block.name.find(".0.weight") == std::string::npos) continue;
    for (std::size_t row = 0; row < values.rows; ++row) {
      for (std::size_t c = 32; c < 35; ++c) values(row, c) *= static_cast<float>(view_gain);
    }
  }
  return model;
}

/// Camera `index` of `count` on a sphere of radius 3 (a Fibonacci spiral), looking at the origin.
inline Camera<double> orbit_camera(std::size_t index, std::size_t count, int size = 64) {
  const double z = 1 - (2 * static_cast<double>(index) + 1) / static_cast<double>(count);
  const double angle = std::numbers::pi * (3 - std::sqrt(5.0)) * static_cast<double>(index),
               radius = std::sqrt(1 - z * z);
  const std::array<double, 3> center{3 * radius * std::cos(angle), 3 * radius * std::sin(angle), 3 * z};
  const std::array<double, 3> forward{-center[0] / 3, -center[1] / 3, -center[2] / 3};
  std::array<double, 3> right{forward[1], -forward[0], 0};  // forward x (0, 0, 1)
  const double norm = std::sqrt(right[0] * right[0] + right[1] * right[1]);
  for (double& component : right) component /= norm;
  const std::array<double, 3> down{forward[1] * right[2] - forward[2] * right[1],
                                   forward[2] * right[0] - forward[0] * right[2],
                                   forward[0] * right[1] - forward[1] * right[0]};
  Camera<double> camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = 1.3 * size;
  camera.cx = camera.cy = 0.5 * size;
  for (std::size_t i = 0; i < 3; ++i) {
    camera.rotation_camera_world[i] = right[i];
    camera.rotation_camera_world[3 + i] = down[i];
    camera.rotation_camera_world[6 + i] = forward[i];
  }
  camera.center_world = center;
  return camera;
}

inline std::vector<Camera<double>> orbit_cameras(std::size_t count, int size = 64) {
  std::vector<Camera<double>> cameras;
  for (std::size_t i = 0; i < count; ++i) cameras.push_back(orbit_camera(i, count, size));
  return cameras;
}

}  // namespace compmark::testing
