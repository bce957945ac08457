// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The input convention of a decoder: how an image is scaled before the network sees it. A decoder that is trained on
// one range and used on another loses accuracy without a warning (docs/spec/watermark.md, 1.4: per-bit bias up to 0.12
// where the spread is 0.02), so the convention is part of the weight file:
//   x = (gain A(LL^levels(image)) - mean_c) / deviation_c,
//   A: shrinking by area so that the larger side is at most largest_side (0: never), or enlarging (bilinear, half-pixel
//      centres) so that it is at least smallest_side: with both equal, a scaled picture is read at the size it was read
//      at before.
// With subject_alone the image is cut to its subject first (subject_box.hpp). With a middle, its middle is read as well
// and the features are the means of both readings: the two err apart, so that a mark counts 13 to 23 % more against
// the scene, for twice the time (docs/notebook/watermark_experiments.md).
// Published HiDDeN files were used on the raw LL: levels 1, gain 1, mean 0, deviation 1. Cost: about two operations a
// pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/area_resize.hpp"
#include "compmark/math/haar.hpp"
#include "compmark/math/resize_adjoint.hpp"
#include "compmark/watermark/decoder/subject_box.hpp"

namespace compmark {

/// The numbers of a convention; the default is that of the published files.
struct InputConvention {
  int haar_levels = 1;  ///< 0, 1 or 2; each doubles the range and halves the size
  double gain = 1;
  std::array<double, 3> mean{0, 0, 0};
  std::array<double, 3> deviation{1, 1, 1};
  int largest_side = 0;        ///< of the network's input; 0: no limit
  int smallest_side = 0;       ///< what its larger side has at least; 0: any; not above largest_side unless that is 0
  bool subject_alone = false;  ///< the image is cut to subject_box() before anything else
  double middle = 0;           ///< share of the sides of the middle that is read too, below 1; 0: none

  bool operator==(const InputConvention&) const = default;

  /// Size of the network's input for an image of `height` x `width`.
  [[nodiscard]] std::array<int, 2> output_size(int height, int width) const {
    for (int level = 0; level < haar_levels; ++level) {
      height = haar_size(height);
      width = haar_size(width);
    }
    const int side = std::max(height, width);
    const int target = largest_side != 0 && side > largest_side ? largest_side : std::max(side, smallest_side);
    if (target == side) return {height, width};
    const auto resized = [&](int n) {
      return std::max(1, static_cast<int>((static_cast<std::int64_t>(2 * n) * target + side) / (2 * side)));
    };
    return {resized(height), resized(width)};
  }
};

/// The parts of an image that are read, each by itself: the image or its subject, then its middle.
struct ReadParts {
  static constexpr std::size_t most = 2;
  std::array<PictureBox, most> boxes{};
  std::size_t count = 1;
};
/// A part with a side below `least` pixels is not read.
template <class T>
[[nodiscard]] ReadParts read_parts(const InputConvention& convention, ImageView<const T> image, int least) {
  ReadParts parts;
  parts.boxes[0] = convention.subject_alone ? subject_box(image, least) : PictureBox{0, 0, image.height, image.width};
  if (convention.middle == 0) return parts;
  parts.boxes[1] = middle_of(parts.boxes[0], convention.middle);
  if (std::min(parts.boxes[1].height, parts.boxes[1].width) >= least) parts.count = 2;
  return parts;
}

/// Normalised low band of [0, 1] RGB with the ImageNet statistics, the same range at any level: the convention of the
/// project's own decoders.
[[nodiscard]] inline InputConvention imagenet_convention(int haar_levels) {
  return {haar_levels, std::ldexp(1.0, -haar_levels), {0.485, 0.456, 0.406}, {0.229, 0.224, 0.225}, 0, 0};
}

/// Bilinear enlarging of an image and its adjoint; the tables are made once a pair of sizes.
template <class T>
class Enlarged {
 public:
  /// Fills `target`.
  template <Executor E>
  void forward(ImageView<const T> image, ImageView<T> target, E& executor) {
    prepare(image.height, image.width, target.height, target.width);
    for (int c = 0; c < image.channels; ++c) resize_->apply(image.plane(c), target.plane(c), context_, executor);
  }
  /// ADDS the adjoint.
  template <Executor E>
  void adjoint(ImageView<const T> d_target, ImageView<T> d_image, E& executor) {
    prepare(d_image.height, d_image.width, d_target.height, d_target.width);
    plane_.resize(d_image.plane_size());
    for (int c = 0; c < d_image.channels; ++c) {
      resize_->apply_adjoint(d_target.plane(c), plane_.data(), context_, executor);
      T* const to = d_image.plane(c);
      for (std::size_t i = 0; i < d_image.plane_size(); ++i) to[i] += plane_[i];
    }
  }

 private:
  void prepare(int height, int width, int to_height, int to_width) {
    const std::array<int, 4> sizes{height, width, to_height, to_width};
    if (resize_ && sizes == sizes_) return;
    resize_.emplace(height, width, to_height, to_width);
    sizes_ = sizes;
  }

  std::optional<TriangleResize<T>> resize_;
  typename TriangleResize<T>::Context context_;
  Buffer<T> plane_;
  std::array<int, 4> sizes_{};
};

/// The map of a convention and its backward pass.
template <class T>
class DecoderInput {
 public:
  struct Context {
    std::array<Buffer<T>, 2> bands;  ///< LL of each level
    AreaResize<T> area;
    Enlarged<T> enlarged;
    int height = 0;  ///< of the image
    int width = 0;
  };

  DecoderInput() = default;
  explicit DecoderInput(const InputConvention& convention) : convention_(convention) {
    COMPMARK_ASSERT(convention.haar_levels >= 0 && convention.haar_levels <= 2, "DecoderInput: 0, 1 or 2 levels");
  }
  [[nodiscard]] const InputConvention& convention() const { return convention_; }

  /// Fills `output` [3, output_size(image)].
  template <Executor E>
  void forward(ImageView<const T> image, ImageView<T> output, Context& context, E& executor) const {
    context.height = image.height;
    context.width = image.width;
    ImageView<const T> at = image;
    for (int level = 0; level < convention_.haar_levels; ++level) {
      const ImageView<T> band = shape(context, level);
      haar_low(at, band, executor);
      at = band;
    }
    if (at.height != output.height || at.width != output.width) {
      if (enlarges(at, output)) {
        context.enlarged.forward(at, output, executor);
      } else {
        context.area.forward(at, output, executor);
      }
      at = output;
    }
    scale(at, output, executor, [&](T value, std::size_t c) {
      return static_cast<T>(convention_.gain / convention_.deviation[c]) * value -
             static_cast<T>(convention_.mean[c] / convention_.deviation[c]);
    });
  }

  /// ADDS to `d_image`; `d_output` is scaled in place.
  template <Executor E>
  void backward(ImageView<T> d_output, ImageView<T> d_image, Context& context, E& executor) const {
    COMPMARK_ASSERT(d_image.height == context.height && d_image.width == context.width,
                    "DecoderInput: the image of forward");
    scale(ImageView<const T>(d_output), d_output, executor,
          [&](T value, std::size_t c) { return static_cast<T>(convention_.gain / convention_.deviation[c]) * value; });
    ImageView<const T> d_at = d_output;
    const int levels = convention_.haar_levels;
    const ImageView<T> d_inner = levels == 0 ? d_image : shape(context, levels - 1);
    const bool resized = d_output.height != d_inner.height || d_output.width != d_inner.width;
    if (resized) {
      if (levels > 0) std::fill_n(d_inner.data, d_inner.size(), T(0));
      if (enlarges(d_inner, d_output)) {
        context.enlarged.adjoint(d_at, d_inner, executor);
      } else {
        context.area.adjoint(d_at, d_inner, executor);
      }
      if (levels == 0) return;
      d_at = d_inner;
    }
    for (int level = levels; level-- > 0;) {
      const ImageView<T> d_wide = level == 0 ? d_image : shape(context, level - 1);
      if (level > 0) std::fill_n(d_wide.data, d_wide.size(), T(0));
      haar_low_adjoint(d_at, d_wide, executor);
      d_at = d_wide;
    }
    if (levels == 0) {
      for (std::size_t i = 0; i < d_image.size(); ++i) d_image.data[i] += d_output.data[i];
    }
  }

 private:
  /// The larger side decides: both sides grow or both shrink.
  template <class From, class To>
  [[nodiscard]] static bool enlarges(const From& from, const To& to) {
    return std::max(to.height, to.width) > std::max(from.height, from.width);
  }
  /// The band behind `level`, for values or gradients.
  [[nodiscard]] ImageView<T> shape(Context& context, int level) const {
    int height = context.height, width = context.width;
    for (int k = 0; k <= level; ++k) {
      height = haar_size(height);
      width = haar_size(width);
    }
    Buffer<T>& buffer = context.bands[static_cast<std::size_t>(level)];
    buffer.resize(3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
    return {buffer.data(), 3, height, width};
  }
  template <class E, class Map>
  static void scale(ImageView<const T> source, ImageView<T> target, E& executor, const Map& map) {
    executor.for_chunks(3, 1, [&](std::size_t c, std::size_t, std::size_t) {
      const T* const from = source.plane(static_cast<int>(c));
      T* const to = target.plane(static_cast<int>(c));
      for (std::size_t i = 0; i < target.plane_size(); ++i) to[i] = map(from[i], c);
    });
  }

  InputConvention convention_;
};

}  // namespace compmark
