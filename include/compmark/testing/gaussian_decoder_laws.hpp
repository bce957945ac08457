// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The laws of a GaussianDecoder (splat/anchor/concept.hpp) as a function a plug-in's own tests can call. Empty text
// means that they hold.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/violations.hpp"

namespace compmark {
namespace testing {

/// A1 to A4 on `rows` random anchors, of which two in three are visible. `D` computes in double; A1 is tried for
/// `samples` values of the anchors and of the decoder's own blocks.
template <GaussianDecoder D>
[[nodiscard]] std::string gaussian_decoder_laws(const D& decoder, std::size_t rows = 40, std::size_t samples = 24) {
  using T = typename D::Scalar;
  static_assert(std::is_same_v<T, double>, "central differences need double");
  Violations violations;
  ParameterArena<T> arena;
  const AnchorHandles handles = add_anchor_blocks(arena, rows, D::shape);
  const auto blocks = D::add_parameters(arena, 3);
  D::initialise(arena, blocks, 5);
  const AnchorColumns<T> anchors = anchor_values(arena, handles);
  const Random random(7, 0, random_stage("testing/gaussian_decoder_laws"));
  std::uint64_t drawn = 0;
  for (const MatrixView<T> table : {anchors.position, anchors.offset, anchors.scaling, anchors.feature}) {
    for (T& value : table.flat()) value = 0.5 * random.normal(drawn++);
  }
  std::vector<std::uint32_t> visible;
  for (std::uint32_t row = 0; row < rows; ++row) {
    if (row % 3 != 1) visible.push_back(row);
  }
  const std::array<double, 3> center{0.3, -0.2, -4};
  const auto read = [&] { return AnchorColumns<const T>(anchor_values(std::as_const(arena), handles)); };

  SerialExecutor serial;
  typename D::Context context;
  GaussianBatch<T> batch;
  const auto decode = [&](auto& ctx, auto& out, auto& executor) {
    return decoder.forward(read(), visible, center, std::size_t{1}, std::as_const(arena), blocks, out, ctx, executor);
  };
  const auto gaussians = [](const GaussianBatch<T>& from, std::size_t count) {
    std::vector<T> values;
    const GaussianColumns<const T> c = from.columns();
    const auto add = [&](const T* column) { values.insert(values.end(), column, column + count); };
    for (const auto* part : {c.mean.data(), c.scale.data(), c.color.data()}) {
      for (std::size_t a = 0; a < 3; ++a) add(part[a]);
    }
    for (const T* column : c.rotation) add(column);
    add(c.opacity);
    return values;
  };
  const std::size_t count = decode(context, batch, serial);
  const std::vector<T> first = gaussians(batch, count);
  const DecodedStatistics<T> said = decoder.statistics(context);
  const bool all_there = batch.size() == count && said.gaussian_slot.size() == count &&
                         said.visible.size() == visible.size() && said.opacity_sum.size() == visible.size();
  violations.expect(all_there, "A4", "forward, the batch and the statistics say different counts");
  if (!all_there) return violations.text();
  std::vector<std::uint32_t> slot(said.gaussian_slot.begin(), said.gaussian_slot.end());
  std::vector<T> sum(rows, T(0));
  const std::uint32_t offsets = static_cast<std::uint32_t>(D::shape.offsets);
  for (std::size_t g = 0; g < count; ++g) {
    const T opacity = std::as_const(batch).columns().opacity[g];
    violations.expect(opacity > 0, "A4", "a Gaussian has an opacity that is not positive");
    violations.expect(slot[g] / offsets < rows && slot[g] / offsets % 3 != 1, "A4",
                      "a Gaussian of an anchor that was not asked for");
    if (slot[g] / offsets < rows) sum[slot[g] / offsets] += opacity;
  }
  for (std::size_t i = 0; i < visible.size(); ++i)
    violations.expect(std::abs(sum[visible[i]] - said.opacity_sum[i]) < 1e-9, "A4",
                      "opacity_sum is not that of an anchor's Gaussians");
  std::sort(slot.begin(), slot.end());
  violations.expect(std::adjacent_find(slot.begin(), slot.end()) == slot.end(), "A4", "two Gaussians of one slot");

  // A loss with a slope for every number of every Gaussian.
  std::vector<T> slopes(first.size());
  for (std::size_t i = 0; i < slopes.size(); ++i) slopes[i] = random.normal((1u << 30) + i);
  const auto loss = [&] {
    const std::size_t now = decode(context, batch, serial);
    const std::vector<T> values = gaussians(batch, now);
    return now == count ? std::inner_product(values.begin(), values.end(), slopes.begin(), T(0)) : T(0);
  };
  GaussianBatch<T> d_batch;
  d_batch.resize(count);
  d_batch.set_zero();
  {
    const GaussianColumns<T> d = d_batch.columns();
    std::size_t at = 0;
    const auto fill = [&](T* column) {
      at = static_cast<std::size_t>(std::copy_n(slopes.begin() + static_cast<std::ptrdiff_t>(at), count, column) -
                                    column) +
           at;
    };
    for (const auto* part : {d.mean.data(), d.scale.data(), d.color.data()}) {
      for (std::size_t a = 0; a < 3; ++a) fill(part[a]);
    }
    for (T* column : d.rotation) fill(column);
    fill(d.opacity);
  }
  const auto gradients = [&](auto& executor) {
    for (T& value : arena.all_gradients()) value = T(0);
    typename D::Context ctx;
    GaussianBatch<T> out;
    decode(ctx, out, executor);
    decoder.backward(read(), visible, center, std::size_t{1}, arena, blocks, std::as_const(d_batch).columns(),
                     anchor_gradients(arena, handles), ctx, executor);
    return std::pair(gaussians(out, out.size()),
                     std::vector<T>(arena.all_gradients().begin(), arena.all_gradients().end()));
  };
  const auto [values, gradient] = gradients(serial);
  static_cast<void>(values);
  const std::string wrong = gradient_law(loss, arena.all_values(), gradient, 1e-6, samples);
  violations.expect(wrong.empty(), "A1", wrong);
  const AnchorColumns<T> d = anchor_gradients(arena, handles);
  for (std::size_t row = 1; row < rows; row += 3) {
    for (const MatrixView<T> table : {d.position, d.offset, d.scaling, d.feature}) {
      for (std::size_t c = 0; c < table.columns; ++c)
        violations.expect(table(row, c) == T(0), "A2", "an anchor that is not visible has a gradient");
    }
  }
  for (const std::size_t threads : {2u, 3u}) {
    ThreadExecutor executor(threads);
    const auto again = gradients(executor);
    violations.expect(again.first == first && again.second == gradient, "A3",
                      "the bits depend on the number of threads");
  }
  return violations.text();
}

}  // namespace testing
}  // namespace compmark
