// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An entropy model whose noise can be left out at run time: the rate is a loss and the steps are learned as ever, so
// that the file is written by the same codec, but what is rendered in training carries no noise of quantization. That
// is the row "without QDL" of the ablations, and nothing that a codec should be trained with. Cost without noise: two
// copies of the visible anchors' attributes each way.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"

namespace ablation {

template <class Base>
class SwitchedNoise : public Base {
 public:
  using Scalar = typename Base::Scalar;
  struct Settings : Base::Settings {
    bool noise = true;
  };
  struct Context : Base::Context {
    std::array<std::vector<Scalar>, 3> kept;
  };

  SwitchedNoise() = default;
  explicit SwitchedNoise(const Settings& settings) : Base(settings), noise_(settings.noise) {}

  template <class E>
  auto forward(const compmark::ParameterArena<Scalar>& arena, const typename Base::Handles& handles,
               std::span<const std::uint32_t> rows, const typename Base::Phase& phase,
               compmark::MatrixView<const Scalar> position, compmark::MatrixView<Scalar> feature,
               compmark::MatrixView<Scalar> scaling, compmark::MatrixView<Scalar> offset, Context& context,
               E& executor) const {
    if (!noise_) keep(rows, {feature, scaling, offset}, context);
    auto report = Base::forward(arena, handles, rows, phase, position, feature, scaling, offset, context, executor);
    if (!noise_) {
      for_kept(rows, {feature, scaling, offset}, context, [](Scalar& value, Scalar kept) { value = kept; });
    }
    return report;
  }

  /// The render saw no noise: its gradient goes past the model, and what the model adds is the rate's alone.
  template <class E>
  void backward(compmark::ParameterArena<Scalar>& arena, const typename Base::Handles& handles,
                std::span<const std::uint32_t> rows, compmark::MatrixView<Scalar> d_feature,
                compmark::MatrixView<Scalar> d_scaling, compmark::MatrixView<Scalar> d_offset, Context& context,
                E& executor) const {
    if (!noise_) {
      keep(rows, {d_feature, d_scaling, d_offset}, context);
      for_kept(rows, {d_feature, d_scaling, d_offset}, context, [](Scalar& value, Scalar) { value = Scalar(0); });
    }
    Base::backward(arena, handles, rows, d_feature, d_scaling, d_offset, context, executor);
    if (!noise_) {
      for_kept(rows, {d_feature, d_scaling, d_offset}, context, [](Scalar& value, Scalar kept) { value += kept; });
    }
  }

 private:
  using Tables = std::array<compmark::MatrixView<Scalar>, 3>;

  static void keep(std::span<const std::uint32_t> rows, const Tables& tables, Context& context) {
    for (std::size_t t = 0; t < 3; ++t) {
      context.kept[t].resize(rows.size() * tables[t].columns);
      for (std::size_t i = 0; i < rows.size(); ++i)
        std::copy_n(tables[t].row(rows[i]), tables[t].columns, context.kept[t].data() + i * tables[t].columns);
    }
  }
  template <class F>
  static void for_kept(std::span<const std::uint32_t> rows, const Tables& tables, const Context& context, const F& f) {
    for (std::size_t t = 0; t < 3; ++t) {
      const std::size_t columns = tables[t].columns;
      for (std::size_t i = 0; i < rows.size(); ++i) {
        Scalar* const row = tables[t].row(rows[i]);
        for (std::size_t c = 0; c < columns; ++c) f(row[c], context.kept[t][i * columns + c]);
      }
    }
  }

  bool noise_ = true;
};

}  // namespace ablation
