// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Before a training begins: that there is something to learn from, and something to measure. Masks may count for nothing at the size they are
// delivered in although their files do not: a few white pixels of a large photograph, or white where the lens has no pixel.
// Cost: decodes the views that have masks, which the store keeps as far as it can.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image_store.hpp"

namespace compmark::inline v0 {

/// An Error if no pixel of any training view counts, or if a view that is measured (a test view; a training view where there are no test views)
/// has no pixel that counts for half or more.
[[nodiscard]] inline Result<Done> check_weights(const Dataset& dataset, ImageStore& store) {
  const bool tests = !dataset.indices(Split::test).empty();
  bool learned = dataset.indices(Split::train).empty();  // whoever has no training views does not train
  const View* masked = nullptr;
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    const View& view = dataset.views[i];
    const bool trains = view.split == Split::train;
    if (view.mask_path.empty()) {
      learned = learned || trains;
      continue;
    }
    const Result<std::span<const std::uint8_t>> mask = store.mask(i);
    if (!mask) return mask.error();
    const std::uint8_t most = mask->empty() ? std::uint8_t{255} : *std::max_element(mask->begin(), mask->end());
    learned = learned || (trains && most > 0);
    if (trains) masked = &view;
    if ((trains && tests) || most >= 128) continue;
    return Error{ErrorKind::invalid, view.mask_path.string(), "mask",
                 "leaves no pixel of the view \"" + view.name + "\" to measure", "correct the mask or remove the view"};
  }
  if (learned) return Done{};
  return Error{ErrorKind::invalid, masked->mask_path.string(), "mask",
               "counts for nothing at the size of the training, as do those of all training views",
               "make white what counts, or remove the masks"};
}

}  // namespace compmark::inline v0
