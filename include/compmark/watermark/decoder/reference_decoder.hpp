// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The definition of a message decoder in plain loops and any scalar: Haar band, normalisation, stem, zero-padded
// convolution, unfolded batch normalisation, GELU by erfc, means, linear, whitening. Slow on purpose: what
// NetworkDecoder is tested against.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "compmark/core/views.hpp"
#include "compmark/math/gelu.hpp"
#include "compmark/watermark/decoder/decoder_stem.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/subject_box.hpp"

namespace compmark {

namespace detail {

/// Planes that answer with the nearest inside value.
template <class S>
struct ReferenceMaps {
  int channels = 0, height = 0, width = 0;
  std::vector<S> values;
  ReferenceMaps(int c, int h, int w)
      : channels(c),
        height(h),
        width(w),
        values(static_cast<std::size_t>(c) * static_cast<std::size_t>(h) * static_cast<std::size_t>(w)) {}
  S& at(int c, int y, int x) {
    y = std::min(y, height - 1);
    x = std::min(x, width - 1);
    return values[(static_cast<std::size_t>(c) * static_cast<std::size_t>(height) + static_cast<std::size_t>(y)) *
                      static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
  [[nodiscard]] bool inside(int y, int x) const { return y >= 0 && x >= 0 && y < height && x < width; }
};

template <class S>
[[nodiscard]] ReferenceMaps<S> reference_input(const InputConvention& convention, ImageView<const S> image) {
  ReferenceMaps<S> maps(3, image.height, image.width);
  std::copy_n(image.data, image.size(), maps.values.begin());
  for (int level = 0; level < convention.haar_levels; ++level) {
    ReferenceMaps<S> band(3, (maps.height + 1) / 2, (maps.width + 1) / 2);
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < band.height; ++y) {
        for (int x = 0; x < band.width; ++x) {
          band.at(c, y, x) = (maps.at(c, 2 * y, 2 * x) + maps.at(c, 2 * y, 2 * x + 1) + maps.at(c, 2 * y + 1, 2 * x) +
                              maps.at(c, 2 * y + 1, 2 * x + 1)) /
                             2;
        }
      }
    }
    maps = band;
  }
  const auto size = convention.output_size(image.height, image.width);
  ReferenceMaps<S> result(3, size[0], size[1]);
  const S rows = S(maps.height) / S(size[0]), columns = S(maps.width) / S(size[1]);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < size[0]; ++y) {
      for (int x = 0; x < size[1]; ++x) {
        S sum = 0;
        if (std::max(size[0], size[1]) > std::max(maps.height, maps.width)) {  // bilinear between pixel centres
          const auto along = [](int i, const S& scale, int last) {
            const S at = std::min(std::max((S(i) + S(0.5)) * scale - S(0.5), S(0)), S(last));
            int low = 0;
            while (low < last && S(low + 1) <= at) ++low;
            return std::pair<int, S>{low, at - S(low)};
          };
          const auto v = along(y, rows, maps.height - 1), u = along(x, columns, maps.width - 1);
          for (int k = 0; k < 4; ++k)
            sum += (k < 2 ? S(1) - v.second : v.second) * (k % 2 == 0 ? S(1) - u.second : u.second) *
                   maps.at(c, v.first + k / 2, u.first + k % 2);
        } else {
          for (int v = 0; v < maps.height; ++v) {
            const S high = std::min(S(v + 1), S(y + 1) * rows) - std::max(S(v), S(y) * rows);
            for (int u = 0; u < maps.width && high > 0; ++u) {
              const S wide = std::min(S(u + 1), S(x + 1) * columns) - std::max(S(u), S(x) * columns);
              if (wide > 0) sum += high * wide * maps.at(c, v, u);
            }
          }
          sum /= rows * columns;
        }
        const std::size_t k = static_cast<std::size_t>(c);
        result.at(c, y, x) = (S(convention.gain) * sum - S(convention.mean[k])) / S(convention.deviation[k]);
      }
    }
  }
  return result;
}

template <class S>
[[nodiscard]] ReferenceMaps<S> reference_layer(const DecoderWeights& weights, const DecoderLayer& layer,
                                               ReferenceMaps<S> maps) {
  if (layer.pool) {
    ReferenceMaps<S> pooled(maps.channels, (maps.height - 3) / 2 + 1, (maps.width - 3) / 2 + 1);
    for (int c = 0; c < pooled.channels; ++c) {
      for (int y = 0; y < pooled.height; ++y) {
        for (int x = 0; x < pooled.width; ++x) {
          S best = maps.at(c, 2 * y, 2 * x);
          for (int k = 1; k < 9; ++k) best = std::max(best, maps.at(c, 2 * y + k / 3, 2 * x + k % 3));
          pooled.at(c, y, x) = best;
        }
      }
    }
    maps = pooled;
  }
  const ConvShape& s = layer.shape;
  ReferenceMaps<S> output(s.out, s.output_size(maps.height), s.output_size(maps.width));
  for (int o = 0; o < s.out; ++o) {
    const std::size_t k = static_cast<std::size_t>(o);
    for (int y = 0; y < output.height; ++y) {
      for (int x = 0; x < output.width; ++x) {
        S sum = S(layer.bias[k]);
        const float* weight = layer.weight.data() + k * s.taps();
        for (int c = 0; c < s.in; ++c) {
          for (int dy = 0; dy < s.kernel; ++dy) {
            for (int dx = 0; dx < s.kernel; ++dx, ++weight) {
              const int v = y * s.stride + dy - s.padding, u = x * s.stride + dx - s.padding;
              if (maps.inside(v, u)) sum += S(*weight) * maps.at(c, v, u);
            }
          }
        }
        if (!layer.norm_weight.empty()) {
          sum = (sum - S(layer.norm_mean[k])) / std::sqrt(S(layer.norm_variance[k]) + S(weights.norm_epsilon)) *
                    S(layer.norm_weight[k]) +
                S(layer.norm_bias[k]);
        }
        output.at(o, y, x) = weights.activation == DecoderActivation::gelu ? gelu(sum) : std::max(sum, S(0));
      }
    }
  }
  return output;
}

}  // namespace detail

/// The features of a part of an image: means of the tapped layers.
template <class S>
[[nodiscard]] std::vector<S> reference_features_of(const DecoderWeights& weights, ImageView<const S> image,
                                                   const PictureBox& box) {
  std::vector<S> part;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < box.height; ++y) {
      for (int x = 0; x < box.width; ++x) part.push_back(image(c, box.top + y, box.left + x));
    }
  }
  image = {part.data(), 3, box.height, box.width};
  detail::ReferenceMaps<S> input = detail::reference_input<S>(weights.input, image);
  detail::ReferenceMaps<S> maps(3 * weights.stem * weights.stem, stem_size(input.height, weights.stem),
                                stem_size(input.width, weights.stem));
  for (int k = 0; k < maps.channels; ++k) {
    const int s = weights.stem;
    for (int y = 0; y < maps.height; ++y) {
      for (int x = 0; x < maps.width; ++x) maps.at(k, y, x) = input.at(k / (s * s), y * s + k / s % s, x * s + k % s);
    }
  }
  std::vector<S> features;
  for (const DecoderLayer& layer : weights.layers) {
    maps = detail::reference_layer(weights, layer, maps);
    if (!layer.tap) continue;
    const std::size_t places = static_cast<std::size_t>(maps.height) * static_cast<std::size_t>(maps.width);
    for (std::size_t c = 0; c < static_cast<std::size_t>(maps.channels); ++c) {
      S sum = 0;
      for (std::size_t i = 0; i < places; ++i) sum += maps.values[c * places + i];
      features.push_back(sum / S(places));
    }
  }
  return features;
}

/// The features of an image: means over the parts of it that are read.
template <class S>
[[nodiscard]] std::vector<S> reference_features(const DecoderWeights& weights, ImageView<const S> image) {
  const ReadParts parts = read_parts(weights.input, image, smallest_picture(weights));
  std::vector<S> sum(static_cast<std::size_t>(weights.features()));
  for (std::size_t p = 0; p < parts.count; ++p) {
    const std::vector<S> features = reference_features_of<S>(weights, image, parts.boxes[p]);
    for (std::size_t f = 0; f < sum.size(); ++f) sum[f] += features[f] / S(parts.count);
  }
  return sum;
}

/// Logits of a hidden or strided decoder.
template <class S>
[[nodiscard]] std::vector<S> reference_logits(const DecoderWeights& weights, ImageView<const S> image) {
  const auto apply = [](const std::vector<float>& matrix, const std::vector<float>& offset, const std::vector<S>& x) {
    std::vector<S> y(offset.begin(), offset.end());
    for (std::size_t r = 0; r < y.size(); ++r) {
      for (std::size_t c = 0; c < x.size(); ++c) y[r] += S(matrix[r * x.size() + c]) * x[c];
    }
    return y;
  };
  std::vector<S> logits = apply(weights.linear_weight, weights.linear_bias, reference_features<S>(weights, image));
  return weights.whiten_bias.empty() ? logits : apply(weights.whiten_weight, weights.whiten_bias, logits);
}

}  // namespace compmark
