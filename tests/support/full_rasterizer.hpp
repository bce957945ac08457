// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A rasterizer that has no memory for some views: those of which `full(camera)` is true are background, and an error.
#pragma once

#include <algorithm>
#include <array>
#include <compmark/core/executor.hpp>
#include <compmark/core/gaussians.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/views.hpp>
#include <compmark/scene/camera.hpp>
#include <compmark/splat/raster/concept.hpp>
#include <cstddef>

namespace compmark::testing {

template <class Inner, auto full>
class FullRasterizer : public Inner {
 public:
  using Inner::Inner;

  template <Executor E>
  RasterReport forward(GaussianColumns<const typename Inner::Scalar> gaussians,
                       const Camera<typename Inner::Scalar>& camera, std::array<typename Inner::Scalar, 3> background,
                       ImageView<typename Inner::Scalar> image, typename Inner::Context& context, E& executor) const {
    RasterReport report = Inner::forward(gaussians, camera, background, image, context, executor);
    if (!full(camera)) return report;
    for (std::size_t c = 0; c < 3; ++c)
      std::fill_n(image.data + c * image.plane_size(), image.plane_size(), background[c]);
    report.error = Error{ErrorKind::exhausted, "", "raster.pair_budget", "one view needs too many", "render less"};
    return report;
  }
};

}  // namespace compmark::testing
