// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One training iteration of a recipe, for effects_free.sh. EFFECT_RECIPE is the recipe; with EFFECT_BY_HAND the pass is
// written out here stage by stage, as it is without effects, and the recipe is plain. One thread; as many iterations as
// the argument says.
#include <array>
#include <bit>
#include <compmark/core/executor.hpp>
#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/context_gs.hpp>
#include <compmark/recipes/far_field.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/marked_codecs.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <compmark/watermark/edit/edit_chain.hpp>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

using namespace compmark;
using namespace compmark::recipes;

/// The one effect of a capture that is in no recipe of the library: a shape of the decoder, which belongs to a trained
/// model.
struct ScaffoldAppearance : DefaultRecipe<float, DecoderShape{.appearance_dim = 32}> {};

// The stages of the watermark, one recipe for each.
struct WithMark : Marked<Scaffold, LatticeDecoder<float>> {};
struct WithFrequencies : WithFrequency<WithMark> {};
struct WithEdits : Marked<Scaffold, EditedDecoder<LatticeDecoder<float>, CommonEdits>> {};
struct WithoutAnchors : WithLostAnchors<WithMark> {};
struct WithNoise : MarkedForCompression<Scaffold, LatticeDecoder<float>> {};

#ifdef EFFECT_BY_HAND
struct R : Scaffold {};
#else
struct R : EFFECT_RECIPE {};
#endif

constexpr int width = 96, height = 64;

#ifdef EFFECT_BY_HAND
/// The passes as they are without effects, cut into the same three functions as Pipeline, so that a compiler inlines the
/// same.
struct Passes {
  using Context = Pipeline<R>::Context;
  template <Executor E>
  ForwardReport forward(const Model<R>& model, const Camera<double>& camera, std::size_t view, Context& c,
                        E& executor) const {
    const Camera<float> at = camera.cast<float>();
    const AnchorColumns<const float> columns = model.columns();
    c.image_storage.resize(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    c.image = {c.image_storage.data(), 3, camera.height, camera.width};
    ForwardReport report;
    R::AnchorModel::find_visible(columns, at, PinholeLens{},
                                 VisibilitySettings{model.render.near_plane, model.render.blur_variance}, c.visible,
                                 c.visibility, executor);
    report.visible_anchors = c.visible.size();
    report.gaussians = decoder.forward(columns, c.visible.span(), camera.center_world, view, model.arena, model.decoder,
                                       c.gaussians, c.decoder, executor);
    report.raster = Pipeline<R>::rasterizer(model.render)
                        .forward(std::as_const(c.gaussians).columns(), at, Pipeline<R>::background(model.render),
                                 c.image, c.raster, executor);
    return report;
  }
  template <Executor E>
  LossReport loss(ImageView<const float> target, const LossWeights& weights, Context& c, E& executor) const {
    c.d_image_storage.resize(c.image.size());
    c.d_image = {c.d_image_storage.data(), 3, c.image.height, c.image.width};
    LossReport report;
    const PhotometricLoss<float> photometric({static_cast<float>(weights.lambda_dssim)});
    const PhotometricReport image =
        photometric.forward_backward<GradientMode::set>(c.image, target, 1.0f, c.d_image, c.photometric, executor);
    report.l1 = image.l1;
    report.ssim = image.ssim;
    report.total = image.loss;
    c.volume_weight = static_cast<float>(weights.lambda_volume);
    if (weights.lambda_volume != 0) {
      const GaussianColumns<const float> gaussians = std::as_const(c.gaussians).columns();
      report.volume = ScaleVolumeLoss<float>{}.forward(gaussians.scale, gaussians.count, c.volume, executor).loss;
      report.total += weights.lambda_volume * report.volume;
    }
    return report;
  }
  template <Executor E>
  void backward(Model<R>& model, const Camera<double>& camera, std::size_t view, Context& c, E& executor) const {
    const Camera<float> at = camera.cast<float>();
    const GaussianColumns<const float> gaussians = std::as_const(c.gaussians).columns();
    c.d_gaussians.resize(c.gaussians.size());
    const GaussianColumns<float> d_gaussians = c.d_gaussians.columns();
    Pipeline<R>::rasterizer(model.render)
        .backward<GradientMode::set>(gaussians, at, Pipeline<R>::background(model.render), c.d_image, d_gaussians,
                                     c.raster, executor);
    if (c.volume_weight != 0) {
      ScaleVolumeLoss<float>{}.forward_backward(gaussians.scale, gaussians.count, c.volume_weight, d_gaussians.scale,
                                                c.volume, executor);
    }
    decoder.backward(std::as_const(model).columns(), c.visible.span(), camera.center_world, view, model.arena,
                     model.decoder, std::as_const(c.d_gaussians).columns(),
                     anchor_gradients(model.arena, model.anchors), c.decoder, executor);
  }
  R::GaussianDecoder decoder;
};
#else
using Passes = Pipeline<R>;
#endif

void iterate(Model<R>& model, const Camera<double>& camera, ImageView<const float> target,
             [[maybe_unused]] const std::vector<float>& ones, Pipeline<R>::Context& context, SerialExecutor& executor) {
  const Passes passes;
  static_cast<void>(passes.forward(model, camera, 0, context, executor));
  if constexpr (present<R::AlphaLoss> || present<R::PixelWeights>) {
    static_cast<void>(Pipeline<R>{}.loss(TargetView<float>(target, ones.data(), ones.data()), {}, context, executor));
  } else {
    static_cast<void>(passes.loss(target, {}, context, executor));
  }
  passes.backward(model, camera, 0, context, executor);
}

}  // namespace

// the anchors' cells are in no iteration, but in how anchors begin and grow; backgrounds are drawn before one
#ifdef EFFECT_TRAINER
template class compmark::Trainer<R, SerialExecutor>;
void grow(Trainer<R, SerialExecutor>& trainer) {
  struct Views {
    [[nodiscard]] std::size_t size() const { return 1; }
    [[nodiscard]] Camera<double> camera(std::size_t) const { return {}; }
    [[nodiscard]] Result<Done> load(std::size_t, ImageView<float>) const { return Done{}; }
    [[nodiscard]] Result<Done> load_planes(std::size_t, std::array<float, 3>, TargetPlanes<float>) const {
      return Done{};
    }
  };
  const Views views;
  static_cast<void>(trainer.step(views));
}
#endif

int main(int, char** argv) {
  Model<R> model;
  model.create(300, 2);
  R::GaussianDecoder::initialise(model.arena, model.decoder, 1);
  model.initialise_stages(1);
  const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
  const Random random(1, 0, random_stage("effect step"));
  for (std::size_t i = 0; i < columns.position.size(); ++i) columns.position.data[i] = random.centered(i);
  for (std::size_t i = 0; i < columns.offset.size(); ++i) columns.offset.data[i] = random.centered(i + 10000);
  for (std::size_t i = 0; i < columns.scaling.size(); ++i) columns.scaling.data[i] = -2.5f;
  for (std::size_t i = 0; i < columns.feature.size(); ++i) columns.feature.data[i] = random.centered(i + 90000);
  Camera<double> camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 90;
  camera.cx = 48;
  camera.cy = 32;
  camera.center_world = {0, 0, -3};
  const std::vector<float> target(3 * width * height, 0.3f), ones(width * height, 1.0f);
  SerialExecutor executor;
  Pipeline<R>::Context context;
  for (int i = 0; i < std::atoi(argv[1]); ++i)
    iterate(model, camera, {target.data(), 3, height, width}, ones, context, executor);
  std::uint64_t hash = 1469598103934665603u;
  const auto mix = [&](std::span<const float> values) {
    for (const float value : values) hash = (hash ^ std::bit_cast<std::uint32_t>(value)) * 1099511628211u;
  };
  mix(context.image.flat());
  for (const BlockHandle block : {model.anchors.offset, model.anchors.feature, model.anchors.scaling})
    mix(model.arena.gradients(block).flat());
  for (const BlockHandle block :
       {model.decoder.opacity.weight1, model.decoder.covariance.weight1, model.decoder.color.weight1})
    mix(model.arena.gradients(block).flat());
  std::printf("%016llx\n", static_cast<unsigned long long>(hash));
  return 0;
}
