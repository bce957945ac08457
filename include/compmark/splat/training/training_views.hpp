// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept TrainingViews: where the trainer gets its images from. A Dataset with an ImageStore is one; a test's own
// images are another.
//
//   v.size()               number of training views
//   v.camera(i)            Camera<double>, at the size of the image; LensCamera for a recipe with a lens
//   v.load(i, image)       fills image [3, height, width] with colours in [0, 1]; an Error if it cannot
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark {

template <class V, class T>
concept TrainingViews = requires(V& views, std::size_t i, ImageView<T> image) {
  { views.size() } -> std::convertible_to<std::size_t>;
  { views.camera(i) } -> std::convertible_to<Camera<double>>;
  { views.load(i, image) } -> std::same_as<Result<Done>>;
};

/// Where the planes of one photograph go. `alpha` and `weight` are null where the recipe does not look at them.
template <class T>
struct TargetPlanes {
  ImageView<T> image;   ///< [3, height, width] colours over the background that load_planes is given
  T* alpha = nullptr;   ///< [height, width] coverage in [0, 1]; 1 where the photograph has no alpha channel
  T* weight = nullptr;  ///< [height, width] how much each pixel counts, [0, 1]; 1 where there is no mask
};

/// What recipes with a random background, an alpha loss or pixel weights need beside it (splat/effect/concept.hpp).
template <class V, class T>
concept PlaneTrainingViews = TrainingViews<V, T> &&
    requires(V& views, std::size_t i, std::array<T, 3> background, TargetPlanes<T> planes) {
  { views.load_planes(i, background, planes) } -> std::same_as<Result<Done>>;
};

/// The published sampling without replacement (docs/spec/method.md, 3.3) as a pure function of the iteration: within
/// each epoch the views are visited in a keyed random order, so a resumed run needs no stack of remaining cameras.
class ViewOrder {
 public:
  ViewOrder(std::uint64_t seed, std::size_t count) : seed_(seed), order_(count) {}

  /// View of 1-based iteration t. Cost: a shuffle at the start of an epoch, else O(1).
  [[nodiscard]] std::size_t at(std::int64_t iteration) {
    const std::size_t step = static_cast<std::size_t>(iteration - 1);
    const std::size_t epoch = step / order_.size();
    if (epoch != epoch_) shuffle(epoch);
    return order_[step % order_.size()];
  }

 private:
  void shuffle(std::size_t epoch) {
    const Random random(seed_, epoch, random_stage("view order"));
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = i;
    for (std::size_t i = order_.size(); i > 1; --i) std::swap(order_[i - 1], order_[random.below(i, i)]);
    epoch_ = epoch;
  }
  std::uint64_t seed_;
  std::vector<std::size_t> order_;
  std::size_t epoch_ = static_cast<std::size_t>(-1);
};

}  // namespace compmark
