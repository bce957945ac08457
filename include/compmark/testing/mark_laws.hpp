// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The laws of a MessageDecoder (watermark/decoder/concept.hpp) as functions a plug-in's own tests can call. Empty text
// means that they hold.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/violations.hpp"
#include "compmark/watermark/decoder/concept.hpp"

namespace compmark {
namespace testing {

/// D1 to D6 at one image size. `decoder` computes in double; `samples` pixels are tried for D1.
template <MessageDecoder D>
[[nodiscard]] std::string message_decoder_laws(const D& decoder, int height, int width, std::size_t samples = 24) {
  using T = typename D::Scalar;
  static_assert(std::is_same_v<T, double>, "central differences need double");
  Violations violations;
  const std::size_t bits = static_cast<std::size_t>(decoder.bits());
  violations.expect(height >= decoder.minimum_size() && width >= decoder.minimum_size(), "D5",
                    "the laws are asked for below minimum_size()");
  const Random random(3, 0, random_stage("testing/message_decoder_laws"));
  const std::size_t count = 3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  std::vector<T> image(count), d_image(count, T(0)), slope(bits), logits(bits);
  for (std::size_t i = 0; i < count; ++i) image[i] = random.uniform(i);
  for (std::size_t i = 0; i < bits; ++i) slope[i] = random.normal(i + (1u << 30));
  const ImageView<const T> view{image.data(), 3, height, width};
  const ImageView<T> d_view{d_image.data(), 3, height, width};

  SerialExecutor serial;
  typename D::Context context;
  const auto loss = [&] {
    decoder.forward(view, logits, context, serial);
    double sum = 0;
    for (std::size_t i = 0; i < bits; ++i) sum += slope[i] * logits[i];
    return sum;
  };
  static_cast<void>(loss());
  const std::vector<T> first = logits;
  decoder.backward(slope, d_view, context, serial);
  const std::vector<T> gradient = d_image;
  violations.expect(gradient_law(loss, image, gradient, 1e-6, samples).empty(), "D1",
                    gradient_law(loss, image, gradient, 1e-6, samples));

  static_cast<void>(loss());
  violations.expect(logits == first, "D6", "a second forward gives other logits");
  for (T& value : d_image) value = T(0.25);
  decoder.backward(slope, d_view, context, serial);
  double worst = 0;
  for (std::size_t i = 0; i < count; ++i) worst = std::max(worst, std::abs(d_image[i] - 0.25 - gradient[i]));
  violations.expect(worst < 1e-12, "D2", "backward overwrites, or differs on a second call");
  const std::vector<T> before = d_image, zeros(bits, T(0));
  decoder.backward(zeros, d_view, context, serial);
  violations.expect(d_image == before, "D2", "zero d_logits move the gradient");

  for (const std::size_t threads : {2u, 3u}) {
    ThreadExecutor executor(threads);
    typename D::Context other;
    std::vector<T> again(bits), d_again(count, T(0));
    decoder.forward(view, again, other, executor);
    decoder.backward(slope, ImageView<T>{d_again.data(), 3, height, width}, other, executor);
    violations.expect(again == first && d_again == gradient, "D3", "the bits depend on the number of threads");
  }

  image[count / 2] = std::numeric_limits<T>::quiet_NaN();
  decoder.forward(view, logits, context, serial);
  bool all_nan = true;
  for (const T value : logits) all_nan = all_nan && std::isnan(value);
  violations.expect(all_nan, "D4", "a NaN pixel gives a number");
  return violations.text();
}

}  // namespace testing
}  // namespace compmark
