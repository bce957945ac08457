// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a picture looks like to somebody who does not mind its tone: the field of its gradients, each shortened to at
// most about 1, as complex numbers on a small square with room around it, and how well two fields agree at every shift
// (a correlation by Fourier transforms). A gain, an offset or a monotone curve leaves the directions of the gradients;
// shortening makes a faint edge count as much as a strong one. Cost: two transforms of [96, 96] a field once, one a
// comparison, ~0.1 ms.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/fft.hpp"
#include "compmark/scene/register/picture_likeness.hpp"

namespace compmark {

/// Complex [side, side], row-major.
struct ComplexField {
  std::vector<float> re, im;
};

/// Side of the square, and the longest side of a picture in it, pixels.
inline constexpr int field_side = 96;
inline constexpr int field_picture = 48;

/// The gradients of a grey picture [height, width] that lies with its corner at (left, top) of the square, central
/// differences over |g| + floor, floor a share of the root mean square; 0 outside `inside` (empty: everywhere), whose
/// neighbours are not read either. Scaled so that the squares sum to 1; all 0 for a picture without an edge.
[[nodiscard]] inline ComplexField gradient_field(const std::vector<float>& grey, const std::vector<char>& inside,
                                                 int width, int height, int left, int top) {
  constexpr std::size_t count = static_cast<std::size_t>(field_side) * field_side;
  ComplexField field{std::vector<float>(count), std::vector<float>(count)};
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  };
  double square = 0;
  const auto each = [&](const auto& body) {
    for (int y = 1; y + 1 < height; ++y) {
      for (int x = 1; x + 1 < width; ++x) {
        if (!inside.empty() && (inside[at(x, y)] == 0 || inside[at(x - 1, y)] == 0 || inside[at(x + 1, y)] == 0 ||
                                inside[at(x, y - 1)] == 0 || inside[at(x, y + 1)] == 0))
          continue;
        const int to_x = left + x, to_y = top + y;
        if (to_x < 0 || to_y < 0 || to_x >= field_side || to_y >= field_side) continue;
        body(static_cast<std::size_t>(to_y) * field_side + static_cast<std::size_t>(to_x),
             grey[at(x + 1, y)] - grey[at(x - 1, y)], grey[at(x, y + 1)] - grey[at(x, y - 1)]);
      }
    }
  };
  std::size_t places = 0;
  each([&](std::size_t, float dx, float dy) {
    square += static_cast<double>(dx * dx + dy * dy);
    ++places;
  });
  const auto floor = static_cast<float>(detail::gradient_floor *
                                        std::sqrt(square / static_cast<double>(std::max<std::size_t>(places, 1))));
  if (!(floor > 1e-6f)) return field;
  double sum = 0;
  each([&](std::size_t place, float dx, float dy) {
    const float scale = 1 / (std::sqrt(dx * dx + dy * dy) + floor);
    field.re[place] = dx * scale;
    field.im[place] = dy * scale;
    sum += static_cast<double>(field.re[place] * field.re[place] + field.im[place] * field.im[place]);
  });
  const auto unit = static_cast<float>(1 / std::sqrt(sum));
  for (std::size_t i = 0; i < count; ++i) {
    field.re[i] *= unit;
    field.im[i] *= unit;
  }
  return field;
}

/// Transforms of fields and their correlation. One for each thread: it has scratch. A template, so that who only
/// includes this does not compile the Fourier transforms in float and long double.
template <class T>
class BasicFieldTransform {
  static_assert(std::is_same_v<T, float>, "a ComplexField is of floats");

 public:
  BasicFieldTransform() : fft_(field_side), turned_{std::vector<float>(count), std::vector<float>(count)} {
    static_assert(field_side % Fft<T>::lanes == 0);
    for (std::vector<float>* room : {&a_re_, &a_im_, &b_re_, &b_im_})
      room->resize(fft_.room() * static_cast<std::size_t>(Fft<T>::lanes));
  }

  /// The field becomes its transform, with the axes exchanged.
  void forward(ComplexField& field) { transform<true>(field); }
  /// The inverse, unscaled.
  void backward(ComplexField& field) { transform<false>(field); }

  struct Peak {
    double value = -1;  ///< of the correlation: 1 for equal fields
    int x = 0, y = 0;   ///< shift of the second field against the first, pixels
  };
  /// The best shift of `second` over `first`, both transformed: the largest of the sums over p of the inner products of
  /// first(p) and second(p + shift).
  [[nodiscard]] Peak peak(const ComplexField& first, const ComplexField& second) {
    ComplexField& product = turned_;
    for (std::size_t i = 0; i < count; ++i) {
      product.re[i] = first.re[i] * second.re[i] + first.im[i] * second.im[i];
      product.im[i] = first.re[i] * second.im[i] - first.im[i] * second.re[i];
    }
    backward(product);
    std::size_t best = 0;
    for (std::size_t i = 1; i < count; ++i) {
      if (product.re[i] > product.re[best]) best = i;
    }
    const auto shift = [](std::size_t k) {
      const int s = static_cast<int>(k);
      return s > field_side / 2 ? s - field_side : s;
    };
    return {static_cast<double>(product.re[best]) / static_cast<double>(count), shift(best % field_side),
            shift(best / field_side)};
  }

 private:
  static constexpr std::size_t count = static_cast<std::size_t>(field_side) * field_side;

  template <bool ahead>
  void columns(ComplexField& field) {
    constexpr auto lanes = static_cast<std::size_t>(Fft<T>::lanes);
    for (std::size_t first = 0; first < field_side; first += lanes) {
      for (std::size_t y = 0; y < field_side; ++y) {
        std::copy_n(field.re.data() + y * field_side + first, lanes, a_re_.data() + y * lanes);
        std::copy_n(field.im.data() + y * field_side + first, lanes, a_im_.data() + y * lanes);
      }
      const ComplexLanes<T> data{a_re_.data(), a_im_.data()}, spare{b_re_.data(), b_im_.data()};
      const ComplexLanes<T> result = ahead ? fft_.forward(data, spare) : fft_.backward(data, spare);
      for (std::size_t y = 0; y < field_side; ++y) {
        std::copy_n(result.re + y * lanes, lanes, field.re.data() + y * field_side + first);
        std::copy_n(result.im + y * lanes, lanes, field.im.data() + y * field_side + first);
      }
    }
  }
  static void exchange_axes(std::vector<float>& plane) {
    for (std::size_t y = 0; y < field_side; ++y) {
      for (std::size_t x = 0; x < y; ++x) std::swap(plane[y * field_side + x], plane[x * field_side + y]);
    }
  }
  template <bool ahead>
  void transform(ComplexField& field) {
    columns<ahead>(field);
    exchange_axes(field.re);
    exchange_axes(field.im);
    columns<ahead>(field);
  }

  Fft<T> fft_;
  std::vector<float> a_re_, a_im_, b_re_, b_im_;
  ComplexField turned_;
};
using FieldTransform = BasicFieldTransform<float>;

}  // namespace compmark
