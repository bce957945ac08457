// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Checks before a training that there are pixels to learn from and pixels to measure. A mask can count for nothing at
// the delivered size although its file does not: a few white pixels of a large photograph, or white where the lens has
// no pixel. Photographs of a single colour (a failed export, everything transparent) teach nothing either. Cost:
// decodes the views that have masks, which the store keeps as far as it can, and the training views up to the first
// that has two colours.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image_store.hpp"

namespace compmark {

namespace detail {

/// The Error of a view of which no pixel counts, by its mask or by its lens.
[[nodiscard]] inline Error nothing_counts(const View& view, std::string problem, std::string remedy) {
  if (!view.mask_path.empty())
    return {ErrorKind::invalid, view.mask_path.string(), "mask", std::move(problem), std::move(remedy)};
  return {ErrorKind::invalid, view.image_path.string(), "lens", std::move(problem),
          "correct the coefficients of its lens, or give --lens ignore"};
}

/// Whether a decoded image of several pixels has one colour, which is `first`, and one opacity.
[[nodiscard]] inline bool is_flat(const StoredImage& image, const std::array<std::uint8_t, 3>& first) {
  const std::size_t n = image.plane_size();
  if (n == 1) return false;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto plane = image.planes.begin() + static_cast<std::ptrdiff_t>(c * n);
    if (std::any_of(plane, plane + static_cast<std::ptrdiff_t>(n), [&](std::uint8_t v) { return v != first[c]; }))
      return false;
  }
  return std::all_of(image.alpha.begin(), image.alpha.end(), [&](std::uint8_t v) { return v == image.alpha[0]; });
}

/// An Error if all training photographs are one colour.
[[nodiscard]] inline Result<Done> check_colors(const Dataset& dataset, ImageStore& store) {
  const std::vector<std::size_t> train = dataset.indices(Split::train);
  std::array<std::uint8_t, 3> first{};
  for (std::size_t k = 0; k < train.size(); ++k) {
    const Result<const StoredImage*> image = store.get(train[k]);
    if (!image) return image.error();
    for (std::size_t c = 0; k == 0 && c < 3; ++c) first[c] = (*image)->planes[c * (*image)->plane_size()];
    if (!is_flat(**image, first)) return Done{};
  }
  if (train.empty()) return Done{};
  return Error{ErrorKind::invalid, dataset.root.string(), "images",
               "are the colour " + std::to_string(first[0]) + " " + std::to_string(first[1]) + " " +
                   std::to_string(first[2]) + " everywhere, all " + std::to_string(train.size()) +
                   " that are trained on, so there is nothing to learn",
               "look at the photographs, and at what is transparent in them"};
}

}  // namespace detail

/// An Error if all training photographs are one colour, if no pixel of any training view counts, or if a view that is
/// measured (a test view; a training view where there are no test views) has no pixel that counts for half or more.
[[nodiscard]] inline Result<Done> check_weights(const Dataset& dataset, ImageStore& store) {
  if (const Result<Done> colors = detail::check_colors(dataset, store); !colors) return colors.error();
  const bool tests = !dataset.indices(Split::test).empty();
  bool learned = dataset.indices(Split::train).empty();  // no training views: nothing will be trained
  const View* masked = nullptr;
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    const View& view = dataset.views[i];
    const bool trains = view.split == Split::train;
    const bool by_lens = view.lens_treatment == LensTreatment::undistort;  // pixels that the photograph does not have
    if (view.mask_path.empty() && !by_lens) {
      learned = learned || trains;
      continue;
    }
    const Result<std::span<const std::uint8_t>> mask = store.mask(i);
    if (!mask) return mask.error();
    const std::uint8_t most = mask->empty() ? std::uint8_t{255} : *std::max_element(mask->begin(), mask->end());
    learned = learned || (trains && most > 0);
    if (trains) masked = &view;
    if ((trains && tests) || most >= 128) continue;
    return detail::nothing_counts(view, "leaves no pixel of the view \"" + view.name + "\" to measure",
                                  "correct the mask or remove the view");
  }
  if (learned) return Done{};
  return detail::nothing_counts(*masked,
                                "counts for nothing at the size of the training, as do those of all training views",
                                "make white what counts, or remove the masks");
}

}  // namespace compmark
