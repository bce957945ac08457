// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A rasterizer of your own: it wraps any other rasterizer in tinted glass. It satisfies the concept, so it can stand in
// a recipe, and the shipped laws check it (docs/adding_a_policy.md explains this file).
#include <array>
#include <compmark/compmark.hpp>
#include <compmark/testing/laws.hpp>
#include <cstdio>
#include <string>

template <compmark::Rasterizer Inner>
class TintedRasterizer {
 public:
  using Scalar = typename Inner::Scalar;
  struct Settings : Inner::Settings {
    std::array<Scalar, 3> tint{Scalar(1), Scalar(0.9), Scalar(0.7)};  ///< what the glass lets through
  };
  struct Context {
    typename Inner::Context inner;
    compmark::Buffer<Scalar> d_image;  ///< gradient behind the glass
  };

  TintedRasterizer() = default;
  explicit TintedRasterizer(const Settings& settings) : settings_(settings), inner_(settings) {}

  template <compmark::Executor E>
  compmark::RasterReport forward(compmark::GaussianColumns<const Scalar> gaussians,
                                 const compmark::Camera<Scalar>& camera, std::array<Scalar, 3> background,
                                 compmark::ImageView<Scalar> image, Context& ctx, E& executor) const {
    const compmark::RasterReport report = inner_.forward(gaussians, camera, background, image, ctx.inner, executor);
    multiply(image, image);
    return report;
  }

  template <compmark::Executor E>
  void backward(compmark::GaussianColumns<const Scalar> gaussians, const compmark::Camera<Scalar>& camera,
                std::array<Scalar, 3> background, compmark::ImageView<const Scalar> d_image,
                compmark::GaussianColumns<Scalar> d_gaussians, Context& ctx, E& executor) const {
    ctx.d_image.resize(d_image.size());
    const compmark::ImageView<Scalar> behind{ctx.d_image.data(), 3, d_image.height, d_image.width};
    multiply(d_image, behind);  // image = tint * inner, so d inner = tint * d image
    inner_.backward(gaussians, camera, background, behind, d_gaussians, ctx.inner, executor);
  }

  compmark::ScreenStatistics<Scalar> screen(const Context& ctx) const { return inner_.screen(ctx.inner); }

 private:
  void multiply(compmark::ImageView<const Scalar> from, compmark::ImageView<Scalar> to) const {
    for (int c = 0; c < 3; ++c) {
      const Scalar tint = settings_.tint[static_cast<std::size_t>(c)];
      for (std::size_t i = 0; i < from.plane_size(); ++i) to.plane(c)[i] = tint * from.plane(c)[i];
    }
  }
  Settings settings_;
  Inner inner_;
};

using Tinted = TintedRasterizer<compmark::TrainingRasterizer<float>>;
static_assert(compmark::Rasterizer<Tinted>);

struct Mine : compmark::recipes::Scaffold {  // all of Scaffold but the rasterizer
  using Rasterizer = Tinted;
};
static_assert(compmark::Recipe<Mine>);

int main() {
  // Every law holds but R6 (weights sum to one): a tinted glass does take light away, and the law says so.
  const std::string broken = compmark::testing::raster_laws(Tinted{});
  std::printf("violations of the laws:\n%s", broken.c_str());
  const bool only_r6 = broken.rfind("R6", 0) == 0 && broken.find('\n') + 1 == broken.size();

  // Clear glass obeys them all, and agrees with the reference rasterizer.
  Tinted::Settings clear;
  clear.tint = {1, 1, 1};
  const std::string none = compmark::testing::raster_laws(Tinted(clear));
  const std::string apart =
      compmark::testing::raster_agrees(Tinted(clear), compmark::ReferenceRasterizer<double>{}, {});
  std::printf("clear glass: %s%s", none.empty() ? "no violation\n" : none.c_str(), apart.c_str());
  return only_r6 && none.empty() && apart.empty() ? 0 : 1;
}
