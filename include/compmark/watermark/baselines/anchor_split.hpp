// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Splits anchors in two as 3D Gaussian splatting splits Gaussians: all sizes of a Gaussian become 1/1.6, and the two
// are drawn from it. On anchors the last rows of a model are copies of others (anchor_copies.hpp): the sizes of both
// shrink, and the offsets of both move at random by half of the anchor's size, about that of a Gaussian. Anchors stay
// where they are, in their cells. A split changes the render. Cost: linear in the copies.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/config.hpp"
#include "compmark/core/random.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark {

/// `originals` are the rows whose copies are the last rows of `model`, in that order.
template <Recipe R>
void split_copies(Model<R>& model, std::span<const std::uint32_t> originals, std::uint64_t seed) {
  using Scalar = typename R::Scalar;
  const double smaller = std::log(1.6);
  const AnchorColumns<Scalar> columns = anchor_values(model.arena, model.anchors);
  COMPMARK_ASSERT(originals.size() <= columns.rows(), "split_copies: more originals than anchors");
  const std::size_t first = columns.rows() - originals.size();
  const Random random(seed, 0, random_stage("anchor split"));
  const auto change = [&](std::size_t row) {
    for (std::size_t i = 0; i < columns.offset.columns; ++i) {
      const double unit = std::exp(static_cast<double>(columns.scaling(row, 3 + i % 3)) -
                                   static_cast<double>(columns.scaling(row, i % 3)));
      columns.offset(row, i) += static_cast<Scalar>(0.5 * unit * random.normal(row * columns.offset.columns + i));
    }
    for (std::size_t axis = 3; axis < 6; ++axis) columns.scaling(row, axis) -= static_cast<Scalar>(smaller);
  };
  for (std::size_t i = 0; i < originals.size(); ++i) {
    change(originals[i]);
    change(first + i);
  }
}

}  // namespace compmark
