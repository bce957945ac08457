// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which anchors are nearest to which in space, and which of two models are in the same place. Exact, by sweeps along an
// axis, with the same bits at any number of threads. Cost: a sort, and of each anchor those within its farthest
// neighbour along the axis, at worst all pairs: .1 s of a thread for 26,535 anchors, 1 s for 80,000 (chair, fern).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

namespace detail {
inline constexpr std::size_t nearest_grain = 256;  ///< rows of a chunk
}  // namespace detail

/// (squared distance, row)
using Neighbour = std::pair<double, std::uint32_t>;

/// Of rows `a` and `b` of positions [rows, 3].
[[nodiscard]] inline double squared_distance(MatrixView<const float> position, std::size_t a, std::size_t b) {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double d = static_cast<double>(position(a, axis)) - static_cast<double>(position(b, axis));
    sum += d * d;
  }
  return sum;
}

/// The `count` nearest rows of each row but itself, nearest first, of equal ones the lower row; fewer where there are
/// fewer. Rows with a place that is not finite have no neighbours and are none. Exact: a sweep along the widest axis.
template <Executor E>
[[nodiscard]] std::vector<std::vector<Neighbour>> nearest_rows(MatrixView<const float> position, std::size_t count,
                                                               E& executor) {
  std::vector<std::uint32_t> order;
  std::array<double, 3> low{}, high{};
  for (std::size_t row = 0; row < position.rows; ++row) {
    if (!(std::isfinite(position(row, 0)) && std::isfinite(position(row, 1)) && std::isfinite(position(row, 2))))
      continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = static_cast<double>(position(row, axis));
      low[axis] = order.empty() ? x : std::min(low[axis], x);
      high[axis] = order.empty() ? x : std::max(high[axis], x);
    }
    order.push_back(static_cast<std::uint32_t>(row));
  }
  std::size_t widest = 0;
  for (std::size_t axis = 1; axis < 3; ++axis) {
    if (high[axis] - low[axis] > high[widest] - low[widest]) widest = axis;
  }
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(position(a, widest), a) < std::pair(position(b, widest), b);
  });
  std::vector<std::vector<Neighbour>> nearest(position.rows);
  const auto find = [&](std::size_t i) {
    std::vector<Neighbour>& found = nearest[order[i]];
    found.reserve(count + 1);
    // Whether anything further along the axis can still be as near.
    const auto look = [&](std::size_t j) {
      const double along =
          static_cast<double>(position(order[j], widest)) - static_cast<double>(position(order[i], widest));
      if (found.size() == count && along * along > found.back().first) return false;
      const Neighbour one{squared_distance(position, order[i], order[j]), order[j]};
      if (found.size() == count && found.back() < one) return true;
      found.insert(std::upper_bound(found.begin(), found.end(), one), one);
      if (found.size() > count) found.pop_back();
      return true;
    };
    bool before = true, after = true;
    for (std::size_t step = 1; before || after; ++step) {
      before = before && step <= i && look(i - step);
      after = after && i + step < order.size() && look(i + step);
    }
  };
  executor.for_chunks(order.size(), detail::nearest_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) find(i);
  });
  return nearest;
}
[[nodiscard]] inline std::vector<std::vector<Neighbour>> nearest_rows(MatrixView<const float> position,
                                                                      std::size_t count) {
  SerialExecutor executor;
  return nearest_rows(position, count, executor);
}

/// For each place [N, 3] the nearest of `among` [M, 3] that is nearer than half the way to the nearest other of the
/// `places`, or in the very place; of equal ones the lower row; none: empty. So no two places have the same one but
/// where they are the same.
template <Executor E>
[[nodiscard]] std::vector<std::optional<std::uint32_t>> same_places(MatrixView<const float> places,
                                                                    MatrixView<const float> among, E& executor) {
  std::vector<std::uint32_t> order;
  for (std::size_t row = 0; row < among.rows; ++row) {
    if (std::isfinite(among(row, 0)) && std::isfinite(among(row, 1)) && std::isfinite(among(row, 2)))
      order.push_back(static_cast<std::uint32_t>(row));
  }
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return std::pair(among(a, 0), a) < std::pair(among(b, 0), b); });
  const auto nearest = nearest_rows(places, 1, executor);
  std::vector<std::optional<std::uint32_t>> found(places.rows);
  const auto find = [&](std::size_t row) {
    const double apart =
        nearest[row].empty() ? std::numeric_limits<double>::max() : nearest[row].front().first;  // squared
    const double x = static_cast<double>(places(row, 0));
    const double reach = 0.5 * std::sqrt(apart);
    double least = 0.25 * apart;
    auto one = std::lower_bound(order.begin(), order.end(), x - reach, [&](std::uint32_t other, double at) {
      return static_cast<double>(among(other, 0)) < at;
    });
    for (; one != order.end() && static_cast<double>(among(*one, 0)) <= x + reach; ++one) {
      double distance = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double d = static_cast<double>(among(*one, axis)) - static_cast<double>(places(row, axis));
        distance += d * d;
      }
      const bool nearer = distance < least || (distance == 0 && !found[row]);
      if (!nearer && !(distance == least && found[row] && *one < *found[row])) continue;
      least = distance;
      found[row] = *one;
    }
  };
  executor.for_chunks(places.rows, detail::nearest_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t row = begin; row < end; ++row) find(row);
  });
  return found;
}

}  // namespace compmark
