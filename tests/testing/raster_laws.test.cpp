// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The shipped laws, on the shipped rasterizers and on rasterizers with one defect each.
#include "compmark/testing/raster_laws.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <string>

#include "compmark/splat/raster/reference.hpp"
#include "compmark/splat/raster/tile.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;
using testing::raster_agrees;
using testing::raster_laws;

TEST_CASE_TEMPLATE("testing/raster_laws: the shipped rasterizers obey R3 to R6", R, TileRasterizer<float>,
                   TileRasterizer<double, accuracy::spec>, ReferenceRasterizer<double>) {
  const std::string broken = raster_laws(R{});
  CHECK_MESSAGE(broken.empty(), broken);
}

TEST_CASE("testing/raster_laws: the tile rasterizer agrees with the reference (R1)") {
  // Both have spec accuracy. float: ~40 blended layers, each one rounding of its weight, and exp of an argument known
  // to 1e-6.
  const std::string apart =
      raster_agrees(TileRasterizer<float, accuracy::spec>{}, ReferenceRasterizer<double, accuracy::spec>{}, {});
  CHECK_MESSAGE(apart.empty(), apart);
}

TEST_CASE("testing/raster_laws: a rasterizer that sees nothing obeys R3 to R6 but does not agree with the reference") {
  const std::string broken = raster_laws(testing::RasterizerArchetype<double>{});
  CHECK(broken.find("R4") == std::string::npos);
  CHECK(broken.find("R5") == std::string::npos);
  CHECK(raster_agrees(testing::RasterizerArchetype<double>{}, ReferenceRasterizer<double>{}, {}).find("R1") !=
        std::string::npos);
}

namespace {

/// Defect: the last Gaussian of the input is blended in front of all others.
struct LastOneFirst : ReferenceRasterizer<double> {
  template <Executor E>
  RasterReport forward(GaussianColumns<const double> g, const Camera<double>& camera, std::array<double, 3> background,
                       ImageView<double> image, Context& ctx, E& executor) const {
    const RasterReport report = ReferenceRasterizer<double>::forward(g, camera, background, image, ctx, executor);
    image(0, 0, 0) += 1e-9 * g.mean[0][g.count - 1];
    return report;
  }
};

/// Defect: the image depends on the number of threads in its last bit.
struct ThreadDependent : ReferenceRasterizer<double> {
  template <Executor E>
  RasterReport forward(GaussianColumns<const double> g, const Camera<double>& camera, std::array<double, 3> background,
                       ImageView<double> image, Context& ctx, E& executor) const {
    const RasterReport report = ReferenceRasterizer<double>::forward(g, camera, background, image, ctx, executor);
    image(1, 3, 3) *= 1 + 1e-15 * static_cast<double>(executor.concurrency());
    return report;
  }
};

/// Defect: loses one per mille of the light.
struct Darkening : ReferenceRasterizer<double> {
  template <Executor E>
  RasterReport forward(GaussianColumns<const double> g, const Camera<double>& camera, std::array<double, 3> background,
                       ImageView<double> image, Context& ctx, E& executor) const {
    const RasterReport report = ReferenceRasterizer<double>::forward(g, camera, background, image, ctx, executor);
    for (double& value : image.flat()) value *= 0.999;
    return report;
  }
};

/// Defect: backward overwrites instead of adding.
struct Overwriting : ReferenceRasterizer<double> {
  template <Executor E>
  void backward(GaussianColumns<const double> g, const Camera<double>& camera, std::array<double, 3> background,
                ImageView<const double> d_image, GaussianColumns<double> d_gaussians, Context& ctx, E& executor) const {
    for (double* column : testing::all_columns(d_gaussians)) {
      for (std::size_t i = 0; i < g.count; ++i) column[i] = 0;
    }
    ReferenceRasterizer<double>::backward(g, camera, background, d_image, d_gaussians, ctx, executor);
  }
};

}  // namespace

TEST_CASE("testing/raster_laws: each law catches its defect (negative controls)") {
  CHECK(raster_laws(LastOneFirst{}).find("R3") != std::string::npos);
  CHECK(raster_laws(ThreadDependent{}).find("R5") != std::string::npos);
  CHECK(raster_laws(Darkening{}).find("R6") != std::string::npos);
  CHECK(raster_laws(Overwriting{}).find("backward") != std::string::npos);
}
