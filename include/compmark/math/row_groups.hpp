// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which rows of numbers are within a distance of other rows. Rows are sorted into groups of 256 by halving them along
// the principal coordinate (principal_axes.hpp) in which they are widest, and a group is looked at only if its box is
// near. Queries come in batches, so that a group is read into the nearest cache once for many: with one query at a time
// memory was what took the time (10 cycles a line). Exact: what the coordinates cannot rule out is measured on the
// numbers themselves, and rounding is allowed for. The distance is that of squared_row_distance: float, the columns in
// order, each square fused into the sum where the build has that instruction. Cost: N log N to build; of N queries
// among M rows N M / 256 tests of boxes, and the groups that are near.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/principal_axes.hpp"

namespace compmark {

/// Of two rows of `columns` numbers. The same bits whichever of the two is first.
[[nodiscard]] inline float squared_row_distance(const float* a, const float* b, std::size_t columns) {
  using Lane = Pack<float, 1>;
  Lane sum(0.0f);
  for (std::size_t k = 0; k < columns; ++k) {
    const Lane d(a[k] - b[k]);
    sum = fma(d, d, sum);
  }
  return sum.native;
}

/// Rows with a number that is not finite are not in it. It holds what it needs of the rows, but not the axes.
class RowGroups {
 public:
  struct Query {
    const float* row = nullptr;  ///< as many numbers as a row has
    float reach = 0;             ///< squared distance; below zero: nothing is asked any more
  };

  /// `axes`, of as many columns, outlive this. Which they are changes the time and no result.
  template <Executor E>
  RowGroups(MatrixView<const float> rows, const PrincipalAxes& axes, E& executor);

  /// Calls visit(index of the query, squared distance, row) for rows, among them all whose squared_row_distance to the
  /// query is at most its reach, which becomes what visit returns. A query that is not finite has no row, and a
  /// distance that overflows float is none. Queries near each other are faster; 64 are as good as more.
  template <class Visit>
  void within(std::span<Query> queries, const Visit& visit) const;

  /// The rows that are in it, neighbours near each other: an order to ask of these rows in.
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }

 private:
  static constexpr std::size_t axes = PrincipalAxes::most;
  static constexpr std::size_t axes_first = 8;    ///< that rule out nearly all
  static constexpr std::size_t group_rows = 256;  ///< 8 axes of them are 8 kB
  static constexpr std::size_t pack_rows = 16;    ///< that are near each other in a group: those of the widest pack
  static constexpr double infinite = std::numeric_limits<double>::infinity();
  using Coordinates = std::array<float, axes>;
  struct Box {
    Coordinates low, high;
    void hold(const Coordinates& at) {
      for (std::size_t a = 0; a < axes; ++a) {
        low[a] = std::min(low[a], at[a]);
        high[a] = std::max(high[a], at[a]);
      }
    }
  };
  struct Place {
    Coordinates at{};
    double slack = 0;    ///< that rounding may have moved two rows apart in the coordinates
    float in_space = 0;  ///< what a distance in the coordinates exceeds only if squared_row_distance exceeds the reach
  };

  void halve(std::size_t begin, std::size_t end, std::size_t unit, const std::vector<Coordinates>& at);
  void set_reach(Query& query, Place& place, float reach) const;
  template <class Visit>
  void look(std::size_t group, std::size_t index, Query& query, Place& place, const Visit& visit) const;
  /// Squared, between two boxes; a place is a box too.
  [[nodiscard]] static float apart(const Coordinates& low, const Coordinates& high, const Box& box);

  const PrincipalAxes* axes_ = nullptr;
  std::size_t columns_ = 0;
  double longest_ = 0;                  ///< row less the mean
  std::vector<std::uint32_t> order_;    ///< row of each place
  std::vector<Box> boxes_;              ///< of each group
  std::vector<float> first_, further_;  ///< coordinates, [group, axis, row of the group]
  std::vector<float> numbers_;          ///< [group, column, row of the group]
};

template <Executor E>
RowGroups::RowGroups(MatrixView<const float> rows, const PrincipalAxes& of, E& executor)
    : axes_(&of),
      columns_(rows.columns) {
  COMPMARK_ASSERT(of.columns == rows.columns, "RowGroups: columns");
  constexpr std::size_t grain = 1024;
  std::vector<Coordinates> at(rows.rows);
  std::vector<double> longest(chunk_count(rows.rows, grain));
  std::vector<unsigned char> in(rows.rows);
  executor.for_chunks(rows.rows, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t row = begin; row < end; ++row) {
      if (!is_finite_row(rows, row)) continue;
      in[row] = 1;
      longest[begin / grain] = std::max(longest[begin / grain], of.coordinates(rows.row(row), at[row]));
    }
  });
  for (const double length : longest) longest_ = std::max(longest_, length);
  for (std::size_t row = 0; row < rows.rows; ++row) {
    if (in[row] != 0) order_.push_back(static_cast<std::uint32_t>(row));
  }
  if (order_.empty()) return;
  halve(0, order_.size(), group_rows, at);
  const std::size_t groups = chunk_count(order_.size(), group_rows);
  boxes_.resize(groups);
  first_.resize(groups * axes_first * group_rows);
  further_.resize(groups * (axes - axes_first) * group_rows);
  numbers_.resize(groups * columns_ * group_rows);
  executor.for_chunks(groups, 1, [&](std::size_t group, std::size_t, std::size_t) {
    const std::size_t begin = group * group_rows;
    halve(begin, std::min(begin + group_rows, order_.size()), pack_rows, at);
    boxes_[group] = {at[order_[begin]], at[order_[begin]]};
    for (std::size_t i = 0; i < group_rows; ++i) {
      // Places behind the last row repeat it, and are not visited.
      const std::uint32_t row = order_[std::min(begin + i, order_.size() - 1)];
      boxes_[group].hold(at[row]);
      const auto put = [&](std::vector<float>& to, std::size_t columns, const float* from) {
        for (std::size_t k = 0; k < columns; ++k) to[(group * columns + k) * group_rows + i] = from[k];
      };
      put(first_, axes_first, at[row].data());
      put(further_, axes - axes_first, at[row].data() + axes_first);
      put(numbers_, columns_, rows.row(row));
    }
  });
}

/// Sorts the places so that whole units of them are halves of halves, along where they are widest.
inline void RowGroups::halve(std::size_t begin, std::size_t end, std::size_t unit, const std::vector<Coordinates>& at) {
  if (end - begin <= unit) return;
  Box box{at[order_[begin]], at[order_[begin]]};
  for (std::size_t i = begin; i < end; ++i) box.hold(at[order_[i]]);
  std::size_t widest = 0;
  for (std::size_t a = 1; a < axes; ++a) {
    if (box.high[a] - box.low[a] > box.high[widest] - box.low[widest]) widest = a;
  }
  const auto place = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  const std::size_t middle = begin + chunk_count(end - begin, unit) / 2 * unit;
  std::nth_element(place(begin), place(middle), place(end), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(at[a][widest], a) < std::pair(at[b][widest], b);
  });
  halve(begin, middle, unit, at);
  halve(middle, end, unit, at);
}

inline void RowGroups::set_reach(Query& query, Place& place, float reach) const {
  query.reach = reach;
  if (!(reach >= 0)) {
    place.in_space = -1;
    return;
  }
  const double length = std::sqrt(static_cast<double>(reach)) + place.slack;
  // Sums of so many squares in float, and the smallest normal numbers.
  const double rounding = 1 + static_cast<double>(2 * columns_ + 32) * 0x1p-24;
  place.in_space = static_cast<float>(std::min(length * length * rounding + 1e-36, infinite));
}

inline float RowGroups::apart(const Coordinates& low, const Coordinates& high, const Box& box) {
  using P = Pack<float>;
  P sum(0.0f);
  for (std::size_t a = 0; a < axes; a += P::width) {
    const P below = P::load(box.low.data() + a) - P::load(high.data() + a),
            above = P::load(low.data() + a) - P::load(box.high.data() + a);
    const P d = max(max(below, above), P(0.0f));  // 0 where one is no number
    sum = fma(d, d, sum);
  }
  return reduce_add(sum);
}

template <class Visit>
void RowGroups::look(std::size_t group, std::size_t index, Query& query, Place& place, const Visit& visit) const {
  using P = Pack<float>;
  constexpr std::size_t width = P::width, together = 4, further = axes - axes_first;
  const auto add = [](P& sum, const float* mine, const float* theirs, std::size_t columns) {
    for (std::size_t k = 0; k < columns; ++k) {
      const P d = P(mine[k]) - P::load(theirs + k * group_rows);
      sum = fma(d, d, sum);
    }
  };
  // A sum of squares never falls, in float neither. One that is no number rules nothing out.
  const auto too_far = [](P sum, float bound) { return all(sum > P(bound)); };
  for (std::size_t row = 0; row < group_rows; row += together * width) {
    P sums[together] = {P(0.0f), P(0.0f), P(0.0f), P(0.0f)};
    const float* theirs = first_.data() + group * axes_first * group_rows + row;
    COMPMARK_GCC_UNROLL(8)
    for (std::size_t k = 0; k < axes_first; ++k, theirs += group_rows) {
      const P mine(place.at[k]);
      for (std::size_t p = 0; p < together; ++p) {
        const P d = mine - P::load(theirs + p * width);
        sums[p] = fma(d, d, sums[p]);
      }
    }
    for (std::size_t p = 0; p < together; ++p) {
      if (too_far(sums[p], place.in_space)) continue;
      const std::size_t at = row + p * width;
      add(sums[p], place.at.data() + axes_first, further_.data() + group * further * group_rows + at, further);
      if (too_far(sums[p], place.in_space)) continue;
      P sum(0.0f);
      constexpr std::size_t step = 8;  // columns until it is asked again
      bool far = false;
      for (std::size_t k = 0; k < columns_ && !far; k += step) {
        add(sum, query.row + k, numbers_.data() + (group * columns_ + k) * group_rows + at,
            std::min(step, columns_ - k));
        far = too_far(sum, query.reach);
      }
      if (far) continue;
      // Not those that overflowed.
      unsigned near = ((sum <= P(query.reach)) & (sum <= P(std::numeric_limits<float>::max()))).bits();
      for (; near != 0; near &= near - 1) {
        const int lane = std::countr_zero(near);
        const std::size_t in_order = group * group_rows + at + static_cast<std::size_t>(lane);
        if (in_order >= order_.size() || !(sum.lane(lane) <= query.reach)) continue;
        set_reach(query, place, visit(index, sum.lane(lane), order_[in_order]));
        if (query.reach < 0) return;
      }
    }
  }
}

template <class Visit>
void RowGroups::within(std::span<Query> queries, const Visit& visit) const {
  std::vector<Place> places(queries.size());
  Box box{};
  Coordinates middle{};
  std::size_t asked = 0;
  for (std::size_t q = 0; q < queries.size(); ++q) {
    Query& query = queries[q];
    if (!(query.reach >= 0) || !is_finite_row({query.row, 1, columns_}, 0)) {
      query.reach = -1;
      continue;
    }
    // The coordinates of either row are rounded, each by 2^-24 of what it is, and the axes are orthonormal to 1e-12.
    places[q].slack = 1e-6 * (axes_->coordinates(query.row, places[q].at) + longest_);
    set_reach(query, places[q], query.reach);
    if (asked++ == 0) box = {places[q].at, places[q].at};
    box.hold(places[q].at);
    for (std::size_t a = 0; a < axes; ++a) middle[a] += places[q].at[a];
  }
  if (asked == 0) return;
  for (float& x : middle) x /= static_cast<float>(asked);
  std::vector<std::pair<float, std::size_t>> likely(boxes_.size());
  for (std::size_t group = 0; group < boxes_.size(); ++group) {
    const float far = apart(middle, middle, boxes_[group]);
    likely[group] = {far < std::numeric_limits<float>::max() ? far : std::numeric_limits<float>::max(), group};
  }
  std::sort(likely.begin(), likely.end());
  for (const auto& [far, group] : likely) {
    float most = -1;
    for (const Place& place : places) most = std::max(most, place.in_space);
    if (apart(box.low, box.high, boxes_[group]) > most) continue;
    for (std::size_t q = 0; q < queries.size(); ++q) {
      if (queries[q].reach < 0 || apart(places[q].at, places[q].at, boxes_[group]) > places[q].in_space) continue;
      look(group, q, queries[q], places[q], visit);
    }
  }
}

}  // namespace compmark
