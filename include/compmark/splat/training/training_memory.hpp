// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Estimates the memory of a training before it is taken: a cloud of three million points needs 11 GB, and a process
// that is killed for memory prints no reason. The sum has the parameters with their gradients, both moments and the
// copies of a row edit; the Gaussians that one view decodes, with their gradients and the rasterizer's lists; the
// planes of one image; and the decoded photographs that the caller keeps. Peaks of whole trainings are 0.75 to 1.3 of
// it (tests/splat/training/training_memory.test.cpp). Growth is unknown: the estimate is for a number of anchors, the
// first one or a limit, and the trainer asks again after each growth (check_growth_memory). Nothing here asks the
// system; the caller gives the available memory. Cost: none.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/number_text.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark {

/// The available memory, and the sizes of a training beside its anchors.
struct MemoryBudget {
  double bytes = 0;        ///< that may be taken; 0: no limit
  std::size_t pixels = 0;  ///< of the largest view
  double images = 0;       ///< bytes of decoded photographs that will be kept
  std::size_t views = 1;   ///< that are trained on
};

/// Bytes by what they are for.
struct TrainingMemory {
  double parameters = 0, gaussians = 0, view = 0, images = 0;
  [[nodiscard]] double total() const { return parameters + gaussians + view + images; }
};

namespace detail {

// Measured, the peak of trainings of 3,000 to 150,000 anchors and of images of 64^2 to 1024^2 pixels: 540 to 690 bytes
// a Gaussian (the most with an entropy model), half of all Gaussians with an opacity above 0, 80 bytes a pixel.
inline constexpr double bytes_per_gaussian = 600, bytes_per_coded_gaussian = 690, share_decoded = 0.5,
                        bytes_per_pixel = 90, bytes_per_marked_pixel = 600;
/// Values, gradients, two moments, and half of the two copies that a row edit makes: its room is taken from what
/// initialising has freed.
inline constexpr double copies_of_parameters = 5;
/// Memory of the cloud and the trees over it, while first anchors are looked for.
inline constexpr double bytes_per_point = 160;

[[nodiscard]] inline std::string gigabytes(double bytes) {
  return bytes < 0.995e9 ? fixed_number(bytes / 1e6, 0) + " MB" : fixed_number(bytes / 1e9, 1) + " GB";
}

/// What the estimate has to know of a recipe: scalars of an anchor and of all networks, and what each costs.
struct MemoryShape {
  double row = 0, fixed = 0, offsets = 0, scalar_bytes = 0;
  bool coded = false, marked = false;
};
template <Recipe R>
[[nodiscard]] MemoryShape memory_shape(std::size_t views) {
  Model<R> model;
  model.create(0, views);
  MemoryShape shape;
  for (const ArenaLayout::Block& block : model.arena.layout().blocks()) {
    if (block.kind == RowKind::anchor) {
      shape.row += static_cast<double>(block.columns);
    } else {
      shape.fixed += static_cast<double>(block.size());
    }
  }
  shape.offsets = R::AnchorModel::shape.offsets;
  shape.scalar_bytes = sizeof(typename R::Scalar);
  shape.coded = present<typename R::EntropyModel>;
  shape.marked = present<typename R::MessageDecoder>;
  return shape;
}

// What follows is compiled once and not for each recipe.
[[nodiscard]] inline TrainingMemory training_memory(const MemoryShape& shape, std::size_t anchors,
                                                    const MemoryBudget& budget) {
  const double n = static_cast<double>(anchors), scalars = shape.scalar_bytes / sizeof(float);
  TrainingMemory memory;
  memory.parameters =
      shape.scalar_bytes * (copies_of_parameters * (shape.row * n + shape.fixed) + n * (2 + 2 * shape.offsets));
  memory.gaussians =
      n * shape.offsets * share_decoded * (shape.coded ? bytes_per_coded_gaussian : bytes_per_gaussian) * scalars;
  memory.view =
      static_cast<double>(budget.pixels) * (shape.marked ? bytes_per_marked_pixel : bytes_per_pixel) * scalars;
  memory.images = budget.images;
  return memory;
}
[[nodiscard]] inline Result<Done> check_training_memory(const MemoryShape& shape, std::size_t anchors,
                                                        const MemoryBudget& budget) {
  const TrainingMemory memory = training_memory(shape, anchors, budget);
  if (!(budget.bytes > 0) || memory.total() <= budget.bytes) return Done{};
  const TrainingMemory none = training_memory(shape, 0, budget);
  const double each = (memory.total() - none.total()) / std::max(1.0, static_cast<double>(anchors));
  const double room = (budget.bytes - none.total()) / each;
  return Error{ErrorKind::exhausted,
               {},
               "memory",
               "training " + std::to_string(anchors) + " anchors takes about " + gigabytes(memory.total()) + ", and " +
                   gigabytes(budget.bytes) + " are free",
               room >= 1
                   ? "give a larger --voxel-size, so that at most " + std::to_string(static_cast<long long>(room)) +
                         " anchors begin, and that as --max-anchors; or fewer points, smaller images "
                         "(--downscale), a smaller --memory-budget"
                   : "give smaller images (--downscale) or a smaller --memory-budget of images"};
}
[[nodiscard]] inline Result<Done> check_growth_memory(const MemoryShape& shape, std::size_t anchors, std::size_t grown,
                                                      const MemoryBudget& budget) {
  const TrainingMemory now = training_memory(shape, anchors, budget),
                       next = training_memory(shape, anchors + grown, budget);
  const double copied = next.parameters * 2 / copies_of_parameters, wanted = next.total() - now.total() + copied;
  if (!(budget.bytes > 0) || wanted <= budget.bytes) return Done{};
  return Error{ErrorKind::exhausted,
               {},
               "memory",
               "another growth like the last one, of " + std::to_string(grown) + " to " + std::to_string(anchors) +
                   " anchors, takes about " + gigabytes(wanted) + ", and " + gigabytes(budget.bytes) + " are free",
               "go on with --resume where there is more, or begin again with --max-anchors " + std::to_string(anchors)};
}

}  // namespace detail

/// The estimate for so many anchors.
template <Recipe R>
[[nodiscard]] TrainingMemory training_memory(std::size_t anchors, const MemoryBudget& budget) {
  return detail::training_memory(detail::memory_shape<R>(budget.views), anchors, budget);
}

/// An Error of kind `exhausted` where so many anchors would take more than there is.
template <Recipe R>
[[nodiscard]] Result<Done> check_training_memory(std::size_t anchors, const MemoryBudget& budget) {
  return detail::check_training_memory(detail::memory_shape<R>(budget.views), anchors, budget);
}
/// An Error of kind `exhausted` where there is not enough for another growth like the last one, which brought `grown`
/// to `anchors`. `budget.bytes` is what is free now, beside all that the training has taken. Asked after a growth: a
/// row edit copies what it edits.
template <Recipe R>
[[nodiscard]] Result<Done> check_growth_memory(std::size_t anchors, std::size_t grown, const MemoryBudget& budget) {
  return detail::check_growth_memory(detail::memory_shape<R>(budget.views), anchors, grown, budget);
}
/// The same as check_training_memory for a cloud of which no cell is known yet: what is taken before anchors can be
/// counted.
[[nodiscard]] inline Result<Done> check_cloud_memory(std::size_t points, const MemoryBudget& budget) {
  const double wanted = static_cast<double>(points) * detail::bytes_per_point;
  if (!(budget.bytes > 0) || wanted <= budget.bytes) return Done{};
  return Error{ErrorKind::exhausted,
               {},
               "memory",
               "a cloud of " + std::to_string(points) + " points takes about " + detail::gigabytes(wanted) +
                   " before the first anchor, and " + detail::gigabytes(budget.bytes) + " are free",
               "thin the point cloud out"};
}

}  // namespace compmark
