// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Learns the cover interference of a scene (watermark/decoder/cover_interference.hpp): pictures of the unmarked model
// are read by a decoder, and a kernel ridge regression tells what it says from the sketch of a picture. How much of it
// a new view will be told is known without more views: each view is told by the others. Cost: a picture and a reading a
// view, and views^3 / 3 multiply-adds.
#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/kernel_ridge.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/cover_interference.hpp"

namespace compmark {

struct CoverInterferenceFit {
  CoverInterference interference;  ///< without the decoder's digest, which its file has
  double deviation = 0;            ///< of the outputs from their means over the views, root mean square
  double told = 0;                 ///< share of that variance which the other views tell of a view; at most 1
};

/// What of the variance of an output its sketch cannot tell, relative to the whole.
inline constexpr double cover_interference_ridge = 0.3;

/// `picture(i)` gives a Result of the i-th of `views` pictures of the unmarked model, as ImageView<const float> in 8
/// bits. The same pictures give the same bits at any thread count. Error: that of a picture; pictures that are all
/// alike, or that the decoder says nothing finite of.
template <MessageDecoder D, class Pictures, Executor E>
[[nodiscard]] Result<CoverInterferenceFit> fit_cover_interference(const D& decoder, std::size_t views,
                                                                  const Pictures& picture, E& executor) {
  const std::size_t outputs = static_cast<std::size_t>(decoder.bits());
  CoverInterferenceFit fit;
  CoverInterference& found = fit.interference;
  typename D::Context context;
  PictureSketch<float> sketch;
  std::vector<double> points, targets, mean(outputs, 0.0);
  std::vector<typename D::Scalar> said(outputs);
  for (std::size_t i = 0; i < views; ++i) {
    const Result<ImageView<const float>> seen = picture(i);
    if (!seen) return seen.error();
    decoder.forward(*seen, std::span(said), context, executor);
    const std::span<const float> one = sketch.of(*seen, executor);
    found.sketch.insert(found.sketch.end(), one.begin(), one.end());
    points.insert(points.end(), one.begin(), one.end());
    for (std::size_t d = 0; d < outputs; ++d) {
      targets.push_back(static_cast<double>(said[d]));
      mean[d] += targets.back() / static_cast<double>(views);
    }
  }
  double all = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    targets[i] -= mean[i % outputs];
    all += targets[i] * targets[i];
  }
  std::optional<KernelRidge> ridge;
  if (views > 0 && all > 0 && std::isfinite(all))
    ridge = kernel_ridge(points, targets, views, cover_interference_ridge, executor);
  if (!ridge) {
    return Error{ErrorKind::invalid,
                 {},
                 "model",
                 "says the same in every view",
                 "give the unmarked model of a scene that is seen"};
  }
  double missed = 0;
  for (const double error : ridge->left_out_error) missed += error * error;
  fit.deviation = std::sqrt(all / static_cast<double>(targets.size()));
  fit.told = 1 - missed / all;
  found.mean.assign(mean.begin(), mean.end());
  found.coefficient.assign(ridge->coefficient.begin(), ridge->coefficient.end());
  return fit;
}

}  // namespace compmark
