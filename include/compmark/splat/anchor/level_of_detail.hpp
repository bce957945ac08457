// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An AnchorModel around another one that leaves out what is too small to be seen from far away: an anchor is decoded if
// the largest standard deviation that its Gaussians can have, exp(max of the last three of its scaling) f / z pixels,
// is at least `least_pixels`. f is the larger focal length, z the depth, held at the near plane. It approximates: what
// is left out is missing from the image. What a threshold costs in time and in error is measured in docs/effects.md; 0
// leaves out nothing, to the bit. A renderer chooses it for a trained model, whose blocks are the other model's. Cost:
// a logarithm and a product of three a visible anchor.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/scaffold_anchors.hpp"
#include "compmark/splat/anchor/visibility.hpp"

namespace compmark {

struct DetailLimit {
  float least_pixels = 0.05f;  ///< standard deviation on the screen, pixels

  friend bool operator==(const DetailLimit&, const DetailLimit&) = default;
};

template <AnchorModel Base, DetailLimit limit = DetailLimit{}>
struct LevelOfDetail : Base {
  using Scalar = typename Base::Scalar;

  template <class Lens, Executor E>
  static void find_visible(const AnchorColumns<const Scalar>& columns, const Camera<Scalar>& camera, const Lens& lens,
                           const VisibilitySettings& settings, Buffer<std::uint32_t>& visible,
                           VisibilityWorkspace& workspace, E& executor) {
    Base::find_visible(columns, camera, lens, settings, visible, workspace, executor);
    const double focal = std::max(static_cast<double>(camera.fx), static_cast<double>(camera.fy));
    const auto& rotation = camera.rotation_camera_world;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < visible.size(); ++i) {
      const std::uint32_t row = visible[i];
      const Scalar* const p = columns.position.row(row);
      const Scalar* const s = columns.scaling.row(row);
      double depth = 0;
      for (std::size_t axis = 0; axis < 3; ++axis)
        depth += static_cast<double>(rotation[6 + axis]) * (static_cast<double>(p[axis]) - camera.center_world[axis]);
      // Compared as logarithms: exp of a giant's scaling is infinite, and the comparison is one with NaN then.
      const double least =
          std::log(static_cast<double>(limit.least_pixels) * std::max(depth, settings.near_plane) / focal);
      const bool small = static_cast<double>(std::max({s[3], s[4], s[5]})) < least;
      if (!small) visible[kept++] = row;
    }
    visible.resize(kept);
  }
};

}  // namespace compmark
