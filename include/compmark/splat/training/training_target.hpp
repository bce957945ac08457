// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The photograph of one iteration, with the planes that stages read: coverage, and the weight of each pixel. A plane
// that no stage reads has no buffer. Cost: a copy of the photograph; coarser, a pass over it more.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <type_traits>

#include "compmark/core/buffer.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/effect/concept.hpp"
#include "compmark/splat/training/coarse_images.hpp"
#include "compmark/splat/training/coarse_to_fine.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/training_views.hpp"

namespace compmark {

template <Recipe R>
class TrainingTarget {
 public:
  using Scalar = typename R::Scalar;
  using Stages = RecipeStages<R>;

  /// Photograph `view`, of the size of `camera`, over the colour `behind`; with a factor above 1 of the size that
  /// make_coarse() gives the camera. An Error of the views, or of a photograph too small for the factor, leaves nothing
  /// to be compared with.
  template <class Views>
  [[nodiscard]] Result<Done> load(Views& views, std::size_t view, const ViewCamera<R>& camera,
                                  const std::array<Scalar, 3>& behind, int factor = 1) {
    if (factor != 1) {
      if (Result<Done> fits = check_coarse_size(factor, camera, "training view " + std::to_string(view)); !fits)
        return fits;
    }
    storage_.resize(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    image_ = {storage_.data(), 3, camera.height, camera.width};
    TargetPlanes<Scalar> planes{image_};
    if constexpr (Stages::needs_target_planes) {
      static_assert(PlaneTrainingViews<Views, Scalar>,
                    "Trainer: this recipe looks at alpha or at pixel weights, so the views need load_planes (see "
                    "splat/training/training_views.hpp)");
      if constexpr (Stages::needs_alpha) {
        planes_.alpha.resize(image_.plane_size());
        planes.alpha = planes_.alpha.data();
      }
      if constexpr (Stages::needs_pixel_weights) {
        planes_.weight.resize(image_.plane_size());
        planes.weight = planes_.weight.data();
      }
      if (Result<Done> loaded = views.load_planes(view, behind, planes); !loaded) return loaded;
    } else {
      if (Result<Done> loaded = views.load(view, image_); !loaded) return loaded;
    }
    if (factor != 1) image_ = make_coarse(planes, factor);
    return Done{};
  }

  [[nodiscard]] TargetView<Scalar> view() const {
    TargetView<Scalar> target(image_);
    if constexpr (Stages::needs_alpha) target.alpha = planes_.alpha.data();
    if constexpr (Stages::needs_pixel_weights) target.weight = planes_.weight.data();
    return target;
  }
  [[nodiscard]] ImageView<const Scalar> image() const { return image_; }
  /// How much each pixel counts, [height, width]; empty if the recipe does not look.
  [[nodiscard]] std::span<const Scalar> weight() const {
    if constexpr (Stages::needs_pixel_weights) {
      return planes_.weight.span().first(image_.plane_size());
    } else {
      return {};
    }
  }

 private:
  struct NoPlanes {};
  struct Planes {
    Buffer<Scalar> alpha, weight;
  };

  Buffer<Scalar> storage_;
  ImageView<Scalar> image_;
  [[no_unique_address]] std::conditional_t<Stages::needs_target_planes, Planes, NoPlanes> planes_;
};

}  // namespace compmark
