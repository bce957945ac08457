// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Some views of a dataset, decoded on demand by its store: what trains and what is measured. Satisfies TrainingViews.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image_store.hpp"
#include "compmark/splat/training/training_views.hpp"

namespace compmark {

struct DatasetViews {
  const Dataset* dataset = nullptr;  ///< both outlive this
  ImageStore* store = nullptr;       ///< may be null where no photograph is asked for
  std::vector<std::size_t> index;    ///< of the dataset's views

  [[nodiscard]] std::size_t size() const { return index.size(); }
  [[nodiscard]] Camera<double> camera(std::size_t i) const { return dataset->views[index[i]].camera; }
  /// The lens that view i has to be rendered through: none where it was taken out of the image, or is ignored.
  [[nodiscard]] Lens lens(std::size_t i) const {
    const View& view = dataset->views[index[i]];
    return view.lens_treatment == LensTreatment::keep ? view.lens : Lens{};
  }
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<float> image) {
    return store->load(dataset->views[index[i]], image);
  }
  /// Colours over another background, coverage and weights: what recipes with effects train on.
  [[nodiscard]] Result<Done> load_planes(std::size_t i, std::array<float, 3> background, TargetPlanes<float> planes) {
    return store->load_planes(index[i], background, planes.image, planes.alpha, planes.weight);
  }
};

}  // namespace compmark
