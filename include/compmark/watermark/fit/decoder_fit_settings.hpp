// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Settings of the fit of a message decoder to a scene (decoder_fit.hpp), and the defaults of what a caller may add: an
// observer, an image codec. The values are those of docs/notebook/watermark_experiments.md. Cost: none.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "compmark/core/views.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"

namespace compmark {

/// Edits of a render before it is read, short of an attack.
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
  int features = 320;           ///< Fourier features; more than bits, or there is nothing to choose
  double period = 0.1;          ///< of the Fourier features, colours in [0, 1]: 26 levels of 255
  double spread_octaves = 1;    ///< either way, of the periods
  int stride = 1;               ///< of the positions that are read, in pixels
  double blur = 0.5;            ///< of the image before, in pixels
  std::uint64_t seed = 0;       ///< of features, views and rotation
  int statistics_views = 2560;  ///< about eight for each feature: fewer determine too little
  int coordinates =
      128;           ///< dimension of the nuisance subspace (watermark/decoder/cover_prediction.hpp); 0: no prediction
  double width = 2;  ///< of the prediction's kernel, in root mean squares of the coordinates
  double prediction_ridge = 0.01;
  double reach = 2;         ///< of the statistics views beyond the neighbours of a training view (scene/novel_view.hpp)
  int gradient_views = 12;  ///< at least 2
  /// Standard deviation of the light of the statistics views, as gains and half as much offset of the channels
  /// (watermark/decoder/tone.hpp). 0: only the unmarked model's own light; such a decoder takes a change of 1 %, or two
  /// levels of green, for a message. The figures of .01: docs/notebook/watermark_experiments.md, "Another light".
  double tone = 0.01;
  /// Every statistics view is read once clean and this often with an edit drawn from `edits`, whose readings have the
  /// weight `edit_weight` in the noise: a direction with little noise in clean renders may have much in a JPEG.
  int edits_per_view = 1;
  double edit_weight = 0.15;
  AugmentationSettings edits = gentle_edits();
  /// Largest number of anchors whose gradients are used; 8 bytes for each of their features and Fourier features.
  std::size_t anchors = 8000;
  double conflict_weight = 0.03;  ///< of the energy beside the noise
  double ridge = 0.003;           ///< share of the mean variance that is added to every variance of the noise
  /// Limit for the logits of one region of an image, in medians over sampled novel views of the unmarked model, of the
  /// logits of the loudest region. A louder region gets a smaller weight (watermark/decoder/lattice_decoder.hpp). 0: no
  /// limit.
  double region_limit = 1.2;
  int regions = 24;  ///< of an image, about
  /// Least positions of a region in the smallest view, or there are fewer regions: small ones would limit a mark that
  /// has to be loud.
  int region_positions = 5000;
  int limit_views = 256;  ///< sampled novel views for the limit; at most statistics_views
};

/// Replaces an image codec, for edits without one: jpeg(image, quality, output) as Augmenter calls it.
struct NoJpeg {
  template <class T>
  void operator()(ImageView<const T> image, int /*quality*/, ImageView<T> output) const {
    std::copy_n(image.data, image.size(), output.data);
  }
};

/// An observer that does nothing. An observer is called after each part of the work, of `total` parts of about the same
/// cost; it returns false to stop.
struct NoFitObserver {
  constexpr bool on_progress(std::size_t /*done*/, std::size_t /*total*/) const { return true; }
};

}  // namespace compmark
