// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From the files of a view to the image that ImageStore delivers. Order: decode, turn, composite over the background at
// full size, take the lens out, then resize the 8-bit planes (docs/spec/method.md, 3.4, which has no lens). The mask
// goes the same way and is the least of what there is: a mask file (black = ignore), the alpha channel if asked for,
// the pixels a photograph without its lens does not have.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image.hpp"
#include "compmark/scene/mask_file.hpp"
#include "compmark/scene/resize.hpp"
#include "compmark/scene/turn.hpp"
#include "compmark/scene/undistort.hpp"

namespace compmark {

struct DecodeSettings {
  std::array<float, 3> background{0, 0, 0};
  AlphaRounding alpha_rounding = AlphaRounding::truncate;  ///< published behaviour
  ResizeFilter filter = ResizeFilter::bicubic;             ///< published behaviour
  bool alpha_mask = false;                                 ///< transparent pixels are also ignored
  bool keep_alpha = false;                                 ///< the alpha channel is kept beside the colours
};

namespace detail {

inline Result<Done> check_size(const View& view, const ImageBytes& file) {
  const auto text = [](int width, int height) { return std::to_string(width) + " x " + std::to_string(height); };
  const bool known = view.file_width > 0;
  // Without a recorded size the proportions must agree: a rounded side may be off by one pixel of the smaller image.
  const double expected_height = static_cast<double>(file.height) * view.camera.width / file.width;
  const bool same = known ? file.width == view.file_width && file.height == view.file_height
                          : std::abs(expected_height - view.camera.height) <= 1.0;
  if (same) return Done{};
  return Error{ErrorKind::invalid, view.image_path.string(), "image size",
               "is " + text(file.width, file.height) + " pixels, but the camera of view \"" + view.name + "\" is for " +
                   (known ? text(view.file_width, view.file_height) : text(view.camera.width, view.camera.height)),
               "put back the image that belongs to this dataset"};
}

/// How much each pixel of a view counts by its mask file, one plane of the image's size.
[[nodiscard]] inline Result<std::vector<std::uint8_t>> read_mask(const View& view, const ImageBytes& image) {
  const Result<MaskFile> file = read_mask_file(view.mask_path);
  if (!file) return file.error();
  ImageBytes mask{file->width, file->height, 1, mask_weights(*file, view.mask_reading)};
  if (mask.width != image.width || mask.height != image.height) mask = turned(std::move(mask), view.orientation);
  if (mask.width != image.width || mask.height != image.height) {
    return mask_of_other_size(view, mask.width, mask.height, image.width, image.height);
  }
  return std::move(mask.pixels);
}

}  // namespace detail

/// The image of a view at the size of its camera. Pixels are those of the published pipeline where there is no lens to
/// take out.
[[nodiscard]] inline Result<StoredImage> decode_view(const View& view, const DecodeSettings& settings) {
  Result<ImageBytes> file = read_image(view.image_path);
  if (!file) return file.error();
  *file = turned(std::move(*file), view.orientation);
  if (Result<Done> matches = detail::check_size(view, *file); !matches) return matches.error();
  StoredImage full{file->width, file->height, {}, {}, {}};
  full.planes.resize(3 * full.plane_size());
  composite(file->pixels, file->channels, settings.background, settings.alpha_rounding, full.planes);

  if (!view.mask_path.empty()) {
    Result<std::vector<std::uint8_t>> mask = detail::read_mask(view, *file);
    if (!mask) return mask.error();
    full.mask = std::move(*mask);
  }
  if (file->channels == 2 || file->channels == 4) {
    const std::size_t channels = static_cast<std::size_t>(file->channels);
    if (settings.alpha_mask) full.mask.resize(full.plane_size(), 255);
    if (settings.keep_alpha) full.alpha.resize(full.plane_size());
    for (std::size_t i = 0; i < full.plane_size(); ++i) {
      const std::uint8_t alpha = file->pixels[i * channels + channels - 1];
      if (settings.alpha_mask) full.mask[i] = std::min(full.mask[i], alpha);
      if (settings.keep_alpha) full.alpha[i] = alpha;
    }
  }
  file->pixels = {};
  if (view.lens_treatment == LensTreatment::undistort) {
    std::vector<std::uint8_t> planes = std::move(full.planes);
    planes.insert(planes.end(), full.mask.begin(), full.mask.end());
    planes.insert(planes.end(), full.alpha.begin(), full.alpha.end());
    UndistortedPlanes straight = undistort_planes(view.camera.resized(full.width, full.height), view.lens, planes);
    const auto colors = straight.planes.begin() + static_cast<std::ptrdiff_t>(3 * full.plane_size());
    const auto masks = colors + static_cast<std::ptrdiff_t>(full.mask.size());
    full.mask.assign(colors, masks);
    full.alpha.assign(masks, straight.planes.end());
    straight.planes.erase(colors, straight.planes.end());
    full.planes = std::move(straight.planes);
    if (!straight.valid.empty()) {
      full.mask.resize(full.plane_size(), 255);
      for (std::size_t i = 0; i < full.mask.size(); ++i) full.mask[i] = std::min(full.mask[i], straight.valid[i]);
    }
  }
  if (std::all_of(full.mask.begin(), full.mask.end(), [](std::uint8_t v) { return v == 255; })) full.mask = {};

  const ImageSize from{full.width, full.height};
  const ImageSize to{view.camera.width, view.camera.height};
  if (from == to) return full;
  StoredImage small{to.width, to.height, {}, {}, {}};
  small.planes.resize(3 * small.plane_size());
  for (std::size_t c = 0; c < 3; ++c) {
    resize_plane(std::span<const std::uint8_t>(full.planes).subspan(c * full.plane_size(), full.plane_size()), from,
                 std::span<std::uint8_t>(small.planes).subspan(c * small.plane_size(), small.plane_size()), to,
                 settings.filter);
  }
  if (!full.alpha.empty()) {  // the filter of the colours, so that the two stay together
    small.alpha.resize(small.plane_size());
    resize_plane(full.alpha, from, small.alpha, to, settings.filter);
  }
  if (!full.mask.empty()) {
    small.mask.resize(small.plane_size());
    resize_plane(full.mask, from, small.mask, to, ResizeFilter::area);  // the share of the pixel that counts
  }
  return small;
}

}  // namespace compmark
