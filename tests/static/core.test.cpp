// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Promises the compiler can check: absence is free, views are plain, shipped policies meet their concepts.
#include <doctest/doctest.h>

#include <type_traits>

#include "compmark/core/absent.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/density_control.hpp"
#include "compmark/splat/anchor/growth.hpp"
#include "compmark/splat/anchor/no_growth.hpp"
#include "compmark/splat/loss/concept.hpp"
#include "compmark/splat/loss/photometric.hpp"
#include "compmark/splat/optim/adam.hpp"
#include "compmark/splat/quantizer/concept.hpp"
#include "compmark/splat/raster/reference.hpp"
#include "compmark/splat/raster/splat.hpp"
#include "compmark/splat/raster/tile.hpp"
#include "compmark/watermark/decoder/concept.hpp"

using namespace compmark;

namespace {

/// What a pipeline looks like when its optional stages are absent.
struct OneStage {
  float present_stage = 0;
  [[no_unique_address]] NoEmbedder embedder;
  [[no_unique_address]] NoMessageDecoder message_decoder;
  [[no_unique_address]] NoQuantizer quantizer;
  [[no_unique_address]] NoDistortion distortion;
};

/// The reason for one type per absence: two members of one empty type must have two addresses.
struct NoThing {};
struct TwoOfOneType {
  [[no_unique_address]] NoThing a;
  [[no_unique_address]] NoThing b;
};
struct TwoOfTwoTypes {
  [[no_unique_address]] NoQuantizer a;
  [[no_unique_address]] NoDistortion b;
};

template <class Stage>
constexpr bool costs_nothing =
    std::is_empty_v<Stage>&& std::is_empty_v<typename Stage::Settings>&& std::is_empty_v<typename Stage::Params>&&
        std::is_empty_v<typename Stage::State>&& std::is_empty_v<typename Stage::Context> &&
    !present<Stage>;

}  // namespace

TEST_CASE("static/core: absent stages take no byte and have no settings, parameters, state or context") {
  CHECK(sizeof(OneStage) == sizeof(float));
  CHECK(sizeof(TwoOfOneType) == 2);  // negative control
  CHECK(sizeof(TwoOfTwoTypes) == 1);
  CHECK(costs_nothing<NoEmbedder>);
  CHECK(costs_nothing<NoMessageDecoder>);
  CHECK(costs_nothing<NoQuantizer>);
  CHECK(costs_nothing<NoDistortion>);
  CHECK_FALSE(present<NoGrowth>);
}

TEST_CASE("static/core: views and columns are trivially copyable and as large as their members") {
  CHECK(std::is_trivially_copyable_v<MatrixView<float>>);
  CHECK(std::is_trivially_copyable_v<ImageView<float>>);
  CHECK(std::is_trivially_copyable_v<GaussianColumns<float>>);
  CHECK(sizeof(MatrixView<float>) == sizeof(void*) + 2 * sizeof(std::size_t));
  CHECK(sizeof(ImageView<float>) <= sizeof(void*) + 4 * sizeof(int));
  CHECK(sizeof(Splat<float>) == 64);
  CHECK(sizeof(SplatGradient<float>) == 64);
  CHECK(alignof(Splat<float>) == 64);
}

TEST_CASE("static/core: shipped policies meet their concepts") {
  CHECK(Executor<SerialExecutor>);
  CHECK(Executor<ThreadExecutor>);
  CHECK(Rasterizer<TileRasterizer<float>>);
  CHECK(Rasterizer<TileRasterizer<double>>);
  CHECK(Rasterizer<TileRasterizer<float, accuracy::inria>>);
  CHECK(Rasterizer<ReferenceRasterizer<float>>);
  CHECK(Rasterizer<ReferenceRasterizer<double>>);
  CHECK(DensityControl<GradientGrowth<float>>);
  CHECK(Optimizer<Adam<float>>);
  CHECK(Optimizer<Adam<double>>);
  CHECK(ImageLoss<PhotometricLoss<float>>);
  CHECK(ImageLoss<PhotometricLoss<double>>);
}

TEST_CASE("static/core: outputs that are not asked for leave no member in the rasterizer's context") {
  using Plain = TileRasterizer<float>::Context;
  using WithAlpha = TileRasterizer<float, accuracy::standard, RasterOutputs{.alpha = true}>::Context;
  using WithAll = TileRasterizer<float, accuracy::standard,
                                 RasterOutputs{.alpha = true, .depth = true, .screen_statistics = true}>::Context;
  CHECK(sizeof(WithAlpha) == sizeof(Plain) + sizeof(Buffer<float>));
  CHECK(sizeof(WithAll) == sizeof(Plain) + 3 * sizeof(Buffer<float>));
  CHECK(sizeof(TileRasterizer<float>) == sizeof(TileRasterizer<float>::Settings));
}
