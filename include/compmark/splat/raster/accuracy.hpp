// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Accuracy as a compile-time policy: every approximation of the rasterizer is a knob with a name, and each preset is a
// promise whose price and error benchmarks/accuracy_vs_time measures. "exact" and "spec" are references (use them with
// Scalar = double).
#pragma once

namespace compmark {

enum class FootprintRule : unsigned char {
  /// the published rule: a square of radius ceil(3 sqrt(lambda_max)) in whole tiles; not opacity-aware
  square_three_sigma,
  opacity_box,  ///< per-axis box where alpha can reach alpha_min
  exact_tiles,  ///< opacity_box, then each tile tested against the ellipse (docs/spec/numerics.md, TB3)
};

enum class StopRule : unsigned char {
  inclusive,  ///< blend, then stop when the transmittance fell below the threshold (docs/spec/numerics.md, BF1)
  exclusive,  ///< the published rule: the Gaussian that would cross the threshold is dropped
};

enum class CutoffRule : unsigned char {
  step,    ///< alpha below alpha_min is skipped
  smooth,  ///< a C1 ramp of width 1e-3 around alpha_min: for finite-difference tests only (docs/spec/numerics.md, BF4)
};

/// Structural, so that it can be a template argument. exp_degree 0 is the standard library's exp.
struct Accuracy {
  int exp_degree = 5;                ///< polynomial degree 2 … 6 of 2^f, or 0 for std::exp
  float alpha_min = 1.0f / 255.0f;   ///< contributions below are skipped; 0 keeps all
  float alpha_max = 0.99f;           ///< opacity of one Gaussian at one pixel is clamped to this
  float transmittance_stop = 1e-4f;  ///< a pixel is finished below this; 0 never stops
  StopRule stop = StopRule::inclusive;
  FootprintRule footprint = FootprintRule::exact_tiles;
  CutoffRule cutoff = CutoffRule::step;
  bool published_backward =
      false;           ///< the published gradient: alpha clamp and frustum clamp not differentiated exactly
  int tile_size = 16;  ///< pixels; a multiple of 16

  friend constexpr bool operator==(const Accuracy&, const Accuracy&) = default;
};

namespace accuracy {
inline constexpr Accuracy exact{.exp_degree = 0, .alpha_min = 1e-7f, .alpha_max = 1.0f, .transmittance_stop = 0.0f};
inline constexpr Accuracy spec{.exp_degree = 0};
inline constexpr Accuracy inria{.exp_degree = 0,
                                .stop = StopRule::exclusive,
                                .footprint = FootprintRule::square_three_sigma,
                                .published_backward = true};
inline constexpr Accuracy quality{
    .exp_degree = 6, .alpha_min = 1.0f / 1024.0f, .alpha_max = 0.9999f, .transmittance_stop = 1e-5f};
inline constexpr Accuracy standard{};
inline constexpr Accuracy fast{.exp_degree = 4, .alpha_min = 1.0f / 128.0f, .transmittance_stop = 1e-3f};
inline constexpr Accuracy draft{.exp_degree = 3, .alpha_min = 1.0f / 64.0f, .transmittance_stop = 1e-2f};
}  // namespace accuracy

}  // namespace compmark
