// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A recipe is a struct that names a stage for every axis. Inherit one from compmark::recipes and rename what you
// change; the reader sees exactly the delta. check_recipe says in sentences what does not fit together.
//
//   alias                 concept                 default
//   Scalar                floating point          float
//   AnchorModel           AnchorModel             ScaffoldAnchors<Scalar>
//   GaussianDecoder       GaussianDecoder         MlpDecoder<Scalar, AnchorModel::shape>
//   Rasterizer            Rasterizer              TileRasterizer<Scalar, accuracy::standard>
//   DensityControl        DensityControl          GradientGrowth<Scalar>        (NoGrowth leaves it out)
//   Space                 Space                   EuclideanSpace                (ContractedSpace: unbounded scenes)
//   Optimizer             Optimizer               Adam<Scalar>
//   Embedder              Embedder                NoEmbedder
//   DistortionLayer       DistortionLayer         NoDistortion
//   Quantizer             Quantizer               NoQuantizer
//   EntropyModel          EntropyModel            NoEntropyModel
//   MessageDecoder        MessageDecoder          NoMessageDecoder
//   HsvLoss               ImageLoss               NoHsvLoss
//   FrequencyLoss         ImageLoss               NoFrequencyLoss
//   Exposure              Exposure                NoExposure
//   Background            Background              ConstantBackground
//   AlphaLoss             AlphaLoss               NoAlphaLoss
//   PixelWeights          PixelWeights            NoPixelWeights
#pragma once

#include <concepts>
#include <type_traits>

#include "compmark/codec/rate/concept.hpp"
#include "compmark/core/absent.hpp"
#include "compmark/scene/lens_camera.hpp"
#include "compmark/splat/anchor/density_control.hpp"
#include "compmark/splat/anchor/scaffold_anchors.hpp"
#include "compmark/splat/anchor/space.hpp"
#include "compmark/splat/effect/concept.hpp"
#include "compmark/splat/loss/concept.hpp"
#include "compmark/splat/optim/concept.hpp"
#include "compmark/splat/quantizer/concept.hpp"
#include "compmark/splat/raster/concept.hpp"
#include "compmark/watermark/decoder/concept.hpp"

namespace compmark {

/// The stages of a recipe: `type` is a StageList. Defined in recipes/recipe_stages.hpp, which every recipe includes:
/// the trainer and the pipeline know that there is a list, not what is in it.
template <class R>
struct StagesOfRecipe;
template <class R>
using RecipeStages = typename StagesOfRecipe<R>::type;

template <class R>
concept Recipe = requires {
  typename R::Scalar;
  typename R::AnchorModel;
  typename R::GaussianDecoder;
  typename R::Rasterizer;
  typename R::DensityControl;
  typename R::Space;
  typename R::Optimizer;
  typename R::Embedder;
  typename R::DistortionLayer;
  typename R::Quantizer;
  typename R::EntropyModel;
  typename R::MessageDecoder;
  typename R::HsvLoss;
  typename R::FrequencyLoss;
  typename R::Exposure;
  typename R::Background;
  typename R::AlphaLoss;
  typename R::PixelWeights;
}
&&std::floating_point<typename R::Scalar>;

namespace detail {
template <class RasterizerType>
struct LensOf {
  using type = PinholeLens;
};
template <class RasterizerType>
  requires requires { typename RasterizerType::EffectPolicy::Lens; }
struct LensOf<RasterizerType> {
  using type = typename RasterizerType::EffectPolicy::Lens;
};
}  // namespace detail

/// The lens that a recipe's Rasterizer projects through.
template <class R>
using RecipeLens = typename detail::LensOf<typename R::Rasterizer>::type;
/// What a recipe calls a view's camera: Camera<double>, and its lens where the Rasterizer has one.
template <class R>
using ViewCamera = CameraOf<RecipeLens<R>>;

/// A recipe's distortion layer, with the steps of the recipe's Quantizer if it has one.
template <class R>
using RecipeDistortion =
    std::conditional_t<present<typename R::Quantizer>,
                       WithQuantizer<typename R::DistortionLayer, typename R::Quantizer>, typename R::DistortionLayer>;

/// A recipe's entropy model, which quantizes as the recipe's Quantizer does if it has one.
template <class R>
using RecipeEntropyModel =
    std::conditional_t<present<typename R::Quantizer>, WithQuantizer<typename R::EntropyModel, typename R::Quantizer>,
                       typename R::EntropyModel>;

/// Whether growing looks at the error map of the frequency loss in a window of the run
/// (splat/anchor/frequency_growth.hpp).
template <class Growth>
inline constexpr bool grows_by_frequency = false;
template <class Growth>
  requires(present<Growth>&& requires(typename Growth::Settings s) {
    s.in_window;
    s.band;
  })
inline constexpr bool grows_by_frequency<Growth> = true;

namespace detail {
/// A concept as a bool, so that the compiler says the sentence and not every expression that is missing: the tables of
/// the concepts' headers name them.
consteval bool holds(bool satisfied) { return satisfied; }
}  // namespace detail

/// Checks that the stages fit together; each error is a sentence. Called by Pipeline, so that a wrong recipe is refused
/// first.
template <Recipe R>
consteval void check_recipe() {
  static_assert(
      detail::holds(Rasterizer<typename R::Rasterizer>),
      "Recipe: Rasterizer lacks forward, backward, screen, Settings or Context (see splat/raster/concept.hpp)");
  static_assert(detail::holds(AnchorModel<typename R::AnchorModel>),
                "Recipe: AnchorModel lacks Scalar, shape, add_parameters or find_visible (see "
                "splat/anchor/scaffold_anchors.hpp)");
  static_assert(detail::holds(GaussianDecoder<typename R::GaussianDecoder>),
                "Recipe: GaussianDecoder lacks Scalar, shape, Handles, Context, add_parameters, initialise, forward, "
                "backward or statistics (see splat/anchor/concept.hpp)");
  static_assert(!present<typename R::DensityControl> || DensityControl<typename R::DensityControl>,
                "Recipe: DensityControl lacks prepare, observe or adapt (see splat/anchor/density_control.hpp)");
  static_assert(detail::holds(Space<typename R::Space>),
                "Recipe: Space lacks cell_of, center, in_range or stretch (see splat/anchor/space.hpp)");
  static_assert(detail::holds(Optimizer<typename R::Optimizer>),
                "Recipe: Optimizer lacks prepare, step or edit_rows (see splat/optim/concept.hpp)");
  static_assert(std::is_same_v<typename R::Scalar, typename R::AnchorModel::Scalar>,
                "Recipe: AnchorModel has another Scalar than the recipe");
  static_assert(std::is_same_v<typename R::Scalar, typename R::Rasterizer::Scalar>,
                "Recipe: Rasterizer has another Scalar than the recipe");
  static_assert(std::is_same_v<typename R::Scalar, typename R::GaussianDecoder::Scalar>,
                "Recipe: GaussianDecoder has another Scalar than the recipe");
  static_assert(R::GaussianDecoder::shape == R::AnchorModel::shape,
                "Recipe: GaussianDecoder reads another shape than AnchorModel stores");
  if constexpr (present<typename R::DensityControl> && requires { R::Rasterizer::output_policy; }) {
    static_assert(R::Rasterizer::output_policy.screen_statistics,
                  "Recipe: DensityControl reads screen statistics, which this Rasterizer does not collect (use "
                  "TrainingRasterizer, or "
                  "NoGrowth)");
  }
  static_assert(detail::holds(Exposure<typename R::Exposure>),
                "Recipe: Exposure lacks add_parameters, forward, backward or fix_gauge (see splat/effect/concept.hpp)");
  static_assert(detail::holds(Background<typename R::Background>),
                "Recipe: Background lacks color (see splat/effect/concept.hpp)");
  static_assert(detail::holds(AlphaLoss<typename R::AlphaLoss>),
                "Recipe: AlphaLoss lacks forward_backward (see splat/effect/concept.hpp)");
  static_assert(detail::holds(PixelWeights<typename R::PixelWeights>),
                "Recipe: PixelWeights lacks mix or apply (see splat/effect/concept.hpp)");
  if constexpr (present<typename R::AlphaLoss> && requires { R::Rasterizer::output_policy; }) {
    static_assert(R::Rasterizer::output_policy.alpha,
                  "Recipe: AlphaLoss reads the coverage, which this Rasterizer does not write (use "
                  "RasterOutputs{.alpha = true})");
  }
  static_assert(detail::holds(Embedder<typename R::Embedder>),
                "Recipe: Embedder lacks target, add_parameters, forward, backward, bake or Handles::residual (see "
                "watermark/decoder/concept.hpp)");
  static_assert(
      detail::holds(MessageDecoder<typename R::MessageDecoder>),
      "Recipe: MessageDecoder lacks bits, minimum_size, forward or backward (see watermark/decoder/concept.hpp)");
  if constexpr (present<typename R::MessageDecoder>) {
    static_assert(std::is_same_v<typename R::Scalar, typename R::MessageDecoder::Scalar>,
                  "Recipe: MessageDecoder has another Scalar than the recipe");
  }
  static_assert(detail::holds(Quantizer<typename R::Quantizer>),
                "Recipe: Quantizer lacks step, step_slope, step_log_slope, symbol, value or error (see "
                "splat/quantizer/concept.hpp)");
  static_assert(detail::holds(DistortionLayer<typename R::DistortionLayer>),
                "Recipe: DistortionLayer lacks add_parameters, initialise, forward or backward (see "
                "splat/quantizer/concept.hpp)");
  static_assert(!present<typename R::DistortionLayer> || present<typename R::Quantizer>,
                "Recipe: a DistortionLayer needs a Quantizer, whose step is its amplitude");
  static_assert(!present<typename R::HsvLoss> || ImageLoss<typename R::HsvLoss>,
                "Recipe: HsvLoss lacks forward or forward_backward (see splat/loss/concept.hpp)");
  static_assert(!present<typename R::FrequencyLoss> || ImageLoss<typename R::FrequencyLoss>,
                "Recipe: FrequencyLoss lacks forward or forward_backward (see splat/loss/concept.hpp)");
  if constexpr (requires { R::DistortionLayer::feature_channels; }) {
    static_assert(R::DistortionLayer::feature_channels == R::AnchorModel::shape.feature_dim,
                  "Recipe: DistortionLayer distorts another number of feature channels than AnchorModel stores");
  }
  if constexpr (requires { R::EntropyModel::feature_channels; }) {
    static_assert(R::EntropyModel::feature_channels == R::AnchorModel::shape.feature_dim,
                  "Recipe: EntropyModel codes another number of feature channels than AnchorModel stores");
  }
  if constexpr (requires { R::EntropyModel::anchor_offsets; }) {
    static_assert(R::EntropyModel::anchor_offsets == R::AnchorModel::shape.offsets,
                  "Recipe: EntropyModel codes another number of offsets than AnchorModel stores");
  }
  if constexpr (grows_by_frequency<typename R::DensityControl>) {
    static_assert(present<typename R::FrequencyLoss>,
                  "Recipe: this DensityControl looks at the error map of a FrequencyLoss, which the recipe lacks");
    static_assert(std::is_same_v<RecipeLens<R>, PinholeLens>,
                  "Recipe: this DensityControl finds Gaussians as a pinhole projects them, and the recipe has a lens");
  }
  static_assert(detail::holds(EntropyModel<typename R::EntropyModel>),
                "Recipe: EntropyModel lacks Phase, Report, add_parameters, initialise, mask_opacity, forward or "
                "backward (see codec/rate/concept.hpp)");
  if constexpr (present<typename R::EntropyModel> && present<typename R::Quantizer>) {
    static_assert(
        requires { typename R::EntropyModel::template WithQuantizer<typename R::Quantizer>; },
        "Recipe: EntropyModel does not quantize by the recipe's Quantizer (the files of HAC and ContextGS hold "
        "steps of AdaptiveQuantizer or UniformQuantizer)");
  }
  static_assert(!present<typename R::EntropyModel> || !present<typename R::DistortionLayer>,
                "Recipe: an EntropyModel draws the noise of its own step, so a DistortionLayer would distort twice");
}

}  // namespace compmark
