// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What projection leaves for the pixel loop, and what the pixel loop hands back: one cache line of floats each.
//
// The exponent of a splat is kept in conditional form (docs/spec/numerics.md, CV2): with d = pixel centre - mean and
// the pivot axis b the one of larger variance (y if c >= a), a the other,
//     w = d_a - slope * d_b,     sigma = major * w^2 + minor * d_b^2  >= 0,     alpha = opacity * exp(-sigma).
// No conic is formed, nothing cancels, and no "power > 0" test is needed.
#pragma once

#include <cstdint>

namespace compmark {

template <class T>
struct alignas(16 * sizeof(T)) Splat {
  T u, v;     // mean, pixels (image frame of scene/camera.hpp)
  T slope;    // covariance(a, b) / variance(b)
  T major;    // variance(b) / (2 det)
  T minor;    // 1 / (2 variance(b))
  T pivot_x;  // 1 if the pivot axis b is x, 0 if it is y
  T opacity;
  T red, green, blue;
  T depth;      // camera z
  T sigma_max;  // ln(opacity / alpha_min): beyond it the splat contributes nothing; infinity when alpha_min is 0
  T half_width, half_height;  // of the region sigma <= sigma_max (or of the published square), pixels
  T unused[2];
};

/// Sums over pixels of one (splat, tile) pair, and after reduction of one splat, with g = -dL/dsigma = alpha dL/dalpha
/// (zero where alpha was clamped): from them follow all gradients without forming an inverse (docs/spec/numerics.md,
/// CV3):
///   dsigma/dd_a = 2 major w,  dsigma/dd_b = 2 minor d_b - slope * 2 major w.
template <class T>
struct alignas(16 * sizeof(T)) SplatGradient {
  T g;                 // sum g;               dL/dopacity = g / opacity
  T g_w, g_b;          // sum g w,  sum g d_b
  T g_ww, g_wb, g_bb;  // sum g w^2, sum g w d_b, sum g d_b^2
  T red, green, blue;  // dL/dcolour
  T depth;             // dL/ddepth through the depth image, when it was asked for
  T unused[6];
};

}  // namespace compmark
