// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The patch loss of WateRF (Jang et al., CVPR 2024, "Patch loss"): a picture is cut into patches of 64 x 64 = 4096
// pixels, the rays that one deferred backward pass takes, and each patch adds
//   0.1 mean |x - y| + 0.06 (1 - SSIM(x, y)) + 0.02 TV(x),
// TV(x) the mean square difference of neighbours, down and to the right. Windows and neighbours end where a patch does.
// The loss of a picture is the sum over its patches, as gradients of patches add up; one that the border cuts counts
// by its pixels. Differs from the paper: patches are squares for the SSIM to see, where rays were taken in rows.
// Cost: that of one pass of L1 and SSIM over the picture, and a copy.
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/loss/photometric.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

/// Of planar images of one shape. The total variation of a picture that equals its target is not 0.
template <class T>
class PatchLoss {
 public:
  using Scalar = T;
  struct Settings {
    double l1 = 0.1, dssim = 0.06, total_variation = 0.02;  ///< weights, at least 0
    int side = 64;                                          ///< of a patch, pixels
  };
  struct Context {
    typename PhotometricLoss<T>::Context photometric;
    Buffer<T> rendered, target, gradient;  ///< of one patch
  };

  Settings settings;

  /// The loss; ADDS `weight` times its gradient to d_rendered.
  template <Executor E>
  double forward_backward(ImageView<const T> rendered, ImageView<const T> target, T weight, ImageView<T> d_rendered,
                          Context& context, E& executor) const {
    COMPMARK_ASSERT(rendered.size() == target.size() && rendered.size() == d_rendered.size() && settings.side > 0,
                    "PatchLoss: three images of one shape");
    const int side = settings.side;
    double sum = 0;
    for (int y = 0; y < rendered.height; y += side) {
      for (int x = 0; x < rendered.width; x += side) {
        const int height = std::min(side, rendered.height - y), width = std::min(side, rendered.width - x);
        const double share = static_cast<double>(height) * width / (static_cast<double>(side) * side);
        const Patch patch{x, y, height, width, rendered.channels};
        const ImageView<T> seen = cut(rendered, patch, context.rendered), wanted = cut(target, patch, context.target);
        context.gradient.resize(seen.size());
        const ImageView<T> d_seen{context.gradient.data(), seen.channels, height, width};
        sum += share * of_patch(seen, wanted, static_cast<T>(share) * weight, d_seen, context, executor);
        add(d_seen, patch, d_rendered);
      }
    }
    return sum;
  }

 private:
  struct Patch {
    int x, y, height, width, channels;
  };
  /// Sets d_seen.
  template <class E>
  double of_patch(ImageView<const T> seen, ImageView<const T> wanted, T weight, ImageView<T> d_seen, Context& context,
                  E& executor) const {
    std::fill_n(d_seen.data, d_seen.size(), T(0));
    double loss = 0;
    const double both = settings.l1 + settings.dssim;
    if (both > 0) {
      const PhotometricLoss<T> photometric({static_cast<T>(settings.dssim / both)});
      loss += both *
              photometric
                  .forward_backward(seen, wanted, static_cast<T>(both) * weight, d_seen, context.photometric, executor)
                  .loss;
    }
    return loss + variation(seen, weight, d_seen);
  }
  double variation(ImageView<const T> seen, T weight, ImageView<T> d_seen) const {
    const double scale = settings.total_variation / static_cast<double>(seen.size());
    const T slope = static_cast<T>(2 * scale) * weight;
    double sum = 0;
    for (int c = 0; c < seen.channels; ++c) {
      for (int y = 0; y < seen.height; ++y) {
        for (int x = 0; x < seen.width; ++x) {
          const auto with = [&](int below, int right) {
            const T difference = seen(c, y + below, x + right) - seen(c, y, x);
            sum += static_cast<double>(difference) * static_cast<double>(difference);
            d_seen(c, y + below, x + right) += slope * difference;
            d_seen(c, y, x) -= slope * difference;
          };
          if (y + 1 < seen.height) with(1, 0);
          if (x + 1 < seen.width) with(0, 1);
        }
      }
    }
    return scale * sum;
  }
  static ImageView<T> cut(ImageView<const T> image, const Patch& patch, Buffer<T>& storage) {
    storage.resize(static_cast<std::size_t>(patch.channels) * static_cast<std::size_t>(patch.height) *
                   static_cast<std::size_t>(patch.width));
    const ImageView<T> part{storage.data(), patch.channels, patch.height, patch.width};
    for (int c = 0; c < patch.channels; ++c) {
      for (int y = 0; y < patch.height; ++y)
        std::copy_n(image.row(c, patch.y + y) + patch.x, patch.width, part.row(c, y));
    }
    return part;
  }
  static void add(ImageView<const T> part, const Patch& patch, ImageView<T> image) {
    for (int c = 0; c < patch.channels; ++c) {
      for (int y = 0; y < patch.height; ++y) {
        T* const to = image.row(c, patch.y + y) + patch.x;
        const T* const from = part.row(c, y);
        for (int x = 0; x < patch.width; ++x) to[x] += from[x];
      }
    }
  }
};

/// The stage of it: its loss is added to every photographed view's.
template <class T>
class PatchLossStage : public Stage<PatchLossStage<T>> {
 public:
  struct Context {
    double loss = 0;  ///< the last one
    typename PatchLoss<T>::Context scratch;
  };

  PatchLoss<T> patch_loss;

  template <class Pass, class Own, class Report>
  void loss(const Pass& pass, const Own& own, Report& report) const {
    own.context.loss = patch_loss.forward_backward(pass.context.image, pass.target.image, T(1), pass.context.d_image,
                                                   own.context.scratch, pass.executor);
    report.total += own.context.loss;
  }
  template <class Own, class Image>
  static void no_loss(const Own& own, const Image& /*image*/) {
    own.context.loss = 0;
  }
};

}  // namespace compmark
