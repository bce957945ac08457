// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ExplicitGaussians, the AnchorModel of models without networks: one Gaussian an anchor, in the feature of
// ExplicitDecoder (splat/anchor/explicit_decoder.hpp). An anchor is visible where the Gaussian itself can be seen:
// Scaffold-GS asks for the ellipsoid of an anchor's offsets instead, which a Gaussian may leave.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_policy.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/explicit_decoder.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/anchor/visibility.hpp"

namespace compmark {

template <class T = float, int sh_degree = 3>
struct ExplicitGaussians {
  using Scalar = T;
  static constexpr DecoderShape shape = ExplicitDecoder<T, sh_degree>::shape;

  [[nodiscard]] static AnchorHandles add_parameters(ParameterArena<T>& arena, std::size_t rows) {
    return add_anchor_blocks(arena, rows, shape);
  }

  /// Through a pinhole the Gaussians in front of the near plane whose ball of four standard deviations, and four of the
  /// screen's blur, meets the pyramid of the image: what is drawn ends at 3.4. Through another lens all of them. NaN is
  /// visible: the decoder counts it. Rows ascend. Cost: one pass over the anchors.
  template <class Lens, Executor E>
  static void find_visible(const AnchorColumns<const T>& columns, const Camera<T>& camera, const Lens& /*lens*/,
                           const VisibilitySettings& settings, Buffer<std::uint32_t>& visible,
                           VisibilityWorkspace& workspace, E& executor) {
    const std::size_t rows = columns.rows(), chunks = chunk_count(rows, grain);
    workspace.found.resize(rows);
    workspace.count.resize(chunks + 1);
    const Pyramid pyramid(camera, settings);
    executor.for_chunks(rows, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::uint32_t* found = workspace.found.data() + begin;
      std::uint32_t count = 0;
      for (std::size_t row = begin; row < end; ++row) {
        if (!std::is_same_v<Lens, PinholeLens> || pyramid.meets(columns, row))
          found[count++] = static_cast<std::uint32_t>(row);
      }
      workspace.count[begin / grain] = count;
    });
    std::size_t total = 0;
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) total += workspace.count[chunk];
    visible.resize(total);
    std::uint32_t* out = visible.data();
    for (std::size_t chunk = 0; chunk < chunks; ++chunk)
      out = std::copy_n(workspace.found.data() + chunk * grain, workspace.count[chunk], out);
  }

 private:
  static constexpr std::size_t grain = 4096;  // anchors

  /// The pyramid of an image, and what a Gaussian may be outside of it.
  class Pyramid {
   public:
    Pyramid(const Camera<T>& camera, const VisibilitySettings& settings)
        : camera_(camera),
          near_(settings.near_plane),
          blur_(4 * std::sqrt(settings.blur)) {
      const double fx = static_cast<double>(camera.fx), fy = static_cast<double>(camera.fy);
      const double cx = static_cast<double>(camera.cx), cy = static_cast<double>(camera.cy);
      sides_ = {{{{fx, 0, cx + blur_}},
                 {{-fx, 0, camera.width - cx + blur_}},
                 {{0, fy, cy + blur_}},
                 {{0, -fy, camera.height - cy + blur_}}}};
      for (std::size_t side = 0; side < 4; ++side)
        length_[side] = std::hypot(sides_[side][0], sides_[side][1], sides_[side][2]);
    }
    [[nodiscard]] bool meets(const AnchorColumns<const T>& columns, std::size_t row) const {
      const T *const x = columns.position.row(row), *const o = columns.offset.row(row),
                     *const s = columns.scaling.row(row);
      std::array<double, 3> world{};
      for (std::size_t axis = 0; axis < 3; ++axis)
        world[axis] = static_cast<double>(x[axis] + o[axis] * std::exp(s[axis])) - camera_.center_world[axis];
      std::array<double, 3> p{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        for (std::size_t k = 0; k < 3; ++k)
          p[axis] += static_cast<double>(camera_.rotation_camera_world[3 * axis + k]) * world[k];
      }
      if (p[2] <= near_) return false;
      const double radius = 4 * std::exp(static_cast<double>(std::max({s[3], s[4], s[5]})));
      for (std::size_t side = 0; side < 4; ++side) {
        const auto& n = sides_[side];
        if (n[0] * p[0] + n[1] * p[1] + n[2] * p[2] < -radius * length_[side]) return false;
      }
      return true;
    }

   private:
    const Camera<T>& camera_;
    double near_, blur_;
    std::array<std::array<double, 3>, 4> sides_{};  // inward normals times the focal length
    std::array<double, 4> length_{};
  };
};

}  // namespace compmark
