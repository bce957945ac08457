// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The figures of a view that compmark evaluate writes: one list for the table, JSON, CSV and the page, so that none of
// them lacks one.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "comparison.hpp"

namespace tool {

struct Measure {
  const char* name;     ///< in JSON and CSV (docs/results.md)
  const char* heading;  ///< of tables
  const char* format;
  /// Empty where it does not apply: no weights, no counterpart, no exposure.
  std::optional<double> (*of_view)(const Comparison&, const ComparedModel&, std::size_t view);
};

namespace measure_of {
template <auto Member>
std::optional<double> in_view(const Comparison&, const ComparedModel& model, std::size_t view) {
  return model.evaluation.views[view].*Member;
}
template <auto Member>
std::optional<double> against_unmarked(const Comparison&, const ComparedModel& model, std::size_t view) {
  if (model.against_unmarked.empty()) return std::nullopt;
  return model.against_unmarked[view].*Member;
}
/// The counterpart's PSNR minus this model's.
inline std::optional<double> lost(const Comparison& comparison, const ComparedModel& model, std::size_t view) {
  if (!model.unmarked) return std::nullopt;
  return comparison.models[*model.unmarked].evaluation.views[view].psnr - model.evaluation.views[view].psnr;
}
}  // namespace measure_of

/// Against the photograph, against the counterpart, and milliseconds. A model's figures are means over the views.
inline constexpr std::array measures = {
    Measure{"psnr", "PSNR, dB", "%.3f", &measure_of::in_view<&compmark::ViewResult::psnr>},
    Measure{"ssim", "SSIM", "%.4f", &measure_of::in_view<&compmark::ViewResult::ssim>},
    Measure{"lpips_alex", "LPIPS-alex", "%.4f", &measure_of::in_view<&compmark::ViewResult::lpips_alex>},
    Measure{"lpips_squeeze", "LPIPS-squeeze", "%.4f", &measure_of::in_view<&compmark::ViewResult::lpips_squeeze>},
    Measure{"psnr_colour_fitted", "PSNR, exposure fitted", "%.3f",
            &measure_of::in_view<&compmark::ViewResult::psnr_colour_fitted>},
    Measure{"psnr_cost_vs_unmarked", "dB lost", "%.3f", &measure_of::lost},
    Measure{"psnr_vs_unmarked", "against unmarked, dB", "%.2f",
            &measure_of::against_unmarked<&compmark::AgainstUnmarked::psnr>},
    Measure{"ssim_vs_unmarked", "SSIM against it", "%.4f",
            &measure_of::against_unmarked<&compmark::AgainstUnmarked::ssim>},
    Measure{"lpips_alex_vs_unmarked", "LPIPS-alex against it", "%.4f",
            &measure_of::against_unmarked<&compmark::AgainstUnmarked::lpips_alex>},
    Measure{"lpips_squeeze_vs_unmarked", "LPIPS-squeeze against it", "%.4f",
            &measure_of::against_unmarked<&compmark::AgainstUnmarked::lpips_squeeze>},
    Measure{"milliseconds", "ms a view", "%.1f", &measure_of::in_view<&compmark::ViewResult::milliseconds>},
};

/// Mean over the views; empty where one of them has no such figure.
inline std::optional<double> mean_of(const Measure& measure, const Comparison& comparison, const ComparedModel& model) {
  const std::size_t views = model.evaluation.views.size();
  double sum = 0;
  for (std::size_t i = 0; i < views; ++i) {
    const std::optional<double> value = measure.of_view(comparison, model, i);
    if (!value) return std::nullopt;
    sum += *value;
  }
  if (views == 0) return std::nullopt;
  return sum / static_cast<double>(views);
}

/// Whether any model has it: a table's column.
inline bool applies(const Measure& measure, const Comparison& comparison) {
  for (const ComparedModel& model : comparison.models) {
    if (mean_of(measure, comparison, model)) return true;
  }
  return false;
}

}  // namespace tool
