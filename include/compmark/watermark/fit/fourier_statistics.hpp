// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Statistics of the Fourier features of an unmarked model, and of the change that a mark could make in them:
// decoder_fit.hpp chooses by these. The mean of a feature is read in sampled novel views, between the training views
// and beyond them; its gradient goes back through the renderer to the anchors' features (fourier_probe.hpp). Cost: a
// render for every statistics view, `features` backward passes for every gradient view, and their inner products.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/row_products.hpp"
#include "compmark/watermark/fit/decoder_fit_settings.hpp"
#include "compmark/watermark/fit/fourier_probe.hpp"

namespace compmark {

namespace detail {

/// `mean` is [features], `deviation` from it [features, readings], the others [features, features]. Readings are
/// `per_view` a view: as it is, then edited.
struct FourierStatistics {
  std::vector<double> mean, deviation, noise, energy, agreement;
  std::size_t per_view = 1;
};
/// Mean product of the rows of `table` [rows, readings]: of the first of every `per_view` readings, and of the others
/// by `edit_weight`.
template <Executor E>
[[nodiscard]] std::vector<double> weighted_products(std::vector<double> table, std::size_t rows, std::size_t per_view,
                                                    double edit_weight, E& executor) {
  const std::size_t readings = table.size() / rows, clean = readings / per_view, edited = readings - clean;
  const double weight = edited == 0 ? 0 : edit_weight;
  for (std::size_t n = 0; n < readings; ++n) {
    const double scale =
        std::sqrt(n % per_view == 0 ? (1 - weight) / static_cast<double>(clean) : weight / static_cast<double>(edited));
    for (std::size_t k = 0; k < rows; ++k) table[k * readings + n] *= scale;
  }
  return row_products(std::span<const double>(table), rows, readings, executor);
}
[[nodiscard]] inline double trace(const std::vector<double>& matrix, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += matrix[i * n + i];
  return sum;
}
/// w^T M w
[[nodiscard]] inline double quadratic(const std::vector<double>& matrix, const double* w, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) {
    double row = 0;
    for (std::size_t j = 0; j < n; ++j) row += matrix[i * n + j] * w[j];
    sum += w[i] * row;
  }
  return sum;
}

/// An Error is that of FourierProbe::render, or of kind cancelled where the observer said stop.
template <Recipe R, class Views, Executor E, class O = NoFitObserver, class Jpeg = NoJpeg>
[[nodiscard]] Result<FourierStatistics> fourier_statistics(FourierProbe<R, Views, E>& probe,
                                                           const DecoderFitSettings& settings, E& executor,
                                                           O&& observer = {}, const Jpeg& jpeg = {}) {
  using T = typename R::Scalar;
  const std::size_t features = static_cast<std::size_t>(settings.features),
                    samples = static_cast<std::size_t>(settings.statistics_views),
                    edits = static_cast<std::size_t>(settings.edits_per_view), per_view = 1 + edits,
                    readings = samples * per_view;
  std::size_t done = 0;
  const std::size_t total = fit_parts(settings);
  FourierStatistics found;
  found.per_view = per_view;
  found.deviation.resize(features * readings);
  found.mean.assign(features, 0.0);
  const auto keep = [&](const std::vector<T>& p, std::size_t n) {
    for (std::size_t k = 0; k < features; ++k) found.deviation[k * readings + n] = static_cast<double>(p[k]);
  };
  for (std::size_t n = 0; n < samples; ++n) {
    if (Result<Done> rendered = probe.render_statistics_view(n); !rendered) return rendered.error();
    keep(probe.means(), n * per_view);
    for (std::size_t e = 0; e < edits; ++e) keep(probe.edited_means(n * edits + e, jpeg), n * per_view + 1 + e);
    if (!observer.on_progress(++done, total)) return fit_stopped();
  }
  for (std::size_t k = 0; k < features; ++k) {
    double* const row = found.deviation.data() + k * readings;
    for (std::size_t n = 0; n < samples; ++n) found.mean[k] += row[n * per_view] / static_cast<double>(samples);
    for (std::size_t n = 0; n < readings; ++n) row[n] -= found.mean[k];
  }
  found.noise = weighted_products(found.deviation, features, per_view, settings.edit_weight, executor);

  // The metric: features that show much are moved less, by the root of their mean square gradient.
  const std::size_t parameters = probe.parameters(), views = static_cast<std::size_t>(settings.gradient_views);
  std::vector<T> one(parameters);
  std::vector<double> square(parameters, 0.0);
  for (std::size_t n = 0; n < views; ++n) {
    if (Result<Done> rendered = probe.render("decoder fit gradient", n); !rendered) return rendered.error();
    for (std::size_t d = 0; d < metric_draws; ++d) {
      probe.signed_gradient(n * metric_draws + d, one);
      if (!observer.on_progress(++done, total)) return fit_stopped();
      for (std::size_t i = 0; i < parameters; ++i)
        square[i] += static_cast<double>(one[i]) * static_cast<double>(one[i]);
    }
  }
  double mean_square = 0;
  for (const double s : square) mean_square += s / static_cast<double>(parameters);
  std::vector<T> scale(parameters);
  for (std::size_t i = 0; i < parameters; ++i) {
    scale[i] =
        static_cast<T>(1 / std::sqrt(square[i] / mean_square + 0.1));  // a tenth: what was hardly seen is not free
  }

  std::vector<T> gradient(features * parameters), sum(features * parameters, T(0));
  found.energy.assign(features * features, 0.0);
  const double count = static_cast<double>(views);
  for (std::size_t n = 0; n < views; ++n) {
    if (Result<Done> rendered = probe.render("decoder fit gradient", n); !rendered) return rendered.error();
    for (std::size_t k = 0; k < features; ++k) {
      T* const row = gradient.data() + k * parameters;
      probe.feature_gradient(k, {row, parameters});
      if (!observer.on_progress(++done, total)) return fit_stopped();
      for (std::size_t i = 0; i < parameters; ++i) {
        row[i] *= scale[i];
        sum[k * parameters + i] += row[i];
      }
    }
    const std::vector<double> own = row_products(std::span<const T>(gradient), features, parameters, executor);
    for (std::size_t i = 0; i < own.size(); ++i) found.energy[i] += own[i] / count;
  }
  found.agreement = row_products(std::span<const T>(sum), features, parameters, executor);
  for (std::size_t i = 0; i < found.agreement.size(); ++i)
    found.agreement[i] = (found.agreement[i] / count - found.energy[i]) / (count - 1);
  return found;
}

}  // namespace detail

}  // namespace compmark
