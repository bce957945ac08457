// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The numbers that a message decoder is fitted to a scene by (decoder_fit.hpp), and what a caller may add: an observer,
// an image codec. The defaults are those of docs/notebook/watermark_experiments.md. Cost: none.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "compmark/core/views.hpp"
#include "compmark/mark/pretrain/augmentation.hpp"

namespace compmark {

/// What befalls an image between its render and who reads it, short of an attack.
[[nodiscard]] inline AugmentationSettings gentle_edits() {
  AugmentationSettings edits;
  edits.weight = {0, 1, 1, 0, 0.5, 1, 1, 2};
  edits.crop_area = {0.5, 1};
  edits.resize_side = {0.5, 1.1};
  edits.blur_sigma = {0.3, 1};
  edits.noise_deviation = {0.005, 0.03};
  edits.brightness = {0.9, 1.1};
  edits.jpeg_quality = {60, 97};
  return edits;
}

struct DecoderFitSettings {
  int bits = 48;
  int waves = 320;              ///< more than bits: there is nothing to choose from otherwise
  double period = 0.1;          ///< of the waves, colours in [0, 1]: 26 levels of 255
  double spread_octaves = 1;    ///< either way, of the periods
  int stride = 1;               ///< of the positions that are read, in pixels: fewer say more of their grid
  double blur = 0.5;            ///< of the image before, in pixels
  std::uint64_t seed = 0;       ///< of waves, views and rotation
  int statistics_views = 2560;  ///< some eight times the waves: fewer say little between them
  int coordinates =
      128;           ///< loud directions that the host's voice is predicted from (mark/host_prediction.hpp); 0: none
  double width = 2;  ///< of the prediction's kernel, in root mean squares of the coordinates
  double prediction_ridge = 0.01;
  double reach = 2;         ///< of the statistics views past the neighbours of a training view (scene/between.hpp)
  int gradient_views = 12;  ///< at least 2
  /// Deviation of the light that every statistics view is seen in, as gains and half as much offset of its channels
  /// (mark/tone.hpp); 0: the host's own, and a decoder that takes 1 % of another, or two levels of green, for a
  /// message. What .01 costs and brings: docs/notebook/watermark_experiments.md, "Another light".
  double tone = 0.01;
  /// Every statistics view is read once as it is, and so often with an edit drawn from `edits`, which has as much
  /// weight in the noise as `edit_weight` says: what is quiet in clean renders alone is drowned by a JPEG.
  int edits_per_view = 1;
  double edit_weight = 0.15;
  AugmentationSettings edits = gentle_edits();
  /// Anchors looked at for the gradients at most; 8 bytes for each of their features and waves.
  std::size_t anchors = 8000;
  double conflict_weight = 0.03;  ///< of the energy beside the noise
  double ridge = 0.003;           ///< share of the mean variance that is added to every variance of the noise
  /// What a region of an image says more than so many medians, over drawn views of the host, of what the loudest region
  /// says, counts less (mark/lattice_decoder.hpp); 0: no limit.
  double region_limit = 1.2;
  int regions = 24;  ///< of an image, about
  /// Of a region of the smallest view at least, or there are fewer: small ones would hold back a mark that has to be
  /// loud.
  int region_positions = 5000;
  int limit_views = 256;  ///< drawn views of the limit; at most statistics_views
};

/// In the place of an image codec, for edits without one: jpeg(image, quality, output) as Augmenter calls it.
struct NoJpeg {
  template <class T>
  void operator()(ImageView<const T> image, int /*quality*/, ImageView<T> output) const {
    std::copy_n(image.data, image.size(), output.data);
  }
};

/// Watches nothing. An observer is told of the way: after a part of the work, of `total` parts of about the same cost;
/// it returns false to stop.
struct NoFitObserver {
  constexpr bool on_progress(std::size_t /*done*/, std::size_t /*total*/) const { return true; }
};

}  // namespace compmark
