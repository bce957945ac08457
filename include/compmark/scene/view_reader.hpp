// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Steps that all readers share. For one image: read its header, decide how it is turned, scale the intrinsics of the
// file to its true size, decide how the lens is treated. At the end: split the views, and report what was noticed in
// one sentence each.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iomanip>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/lens.hpp"
#include "compmark/scene/resize.hpp"
#include "compmark/scene/turn.hpp"

namespace compmark {
namespace detail {

[[nodiscard]] inline std::string two_digits(double value) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << value;
  return text.str();
}

/// A side in pixels that a camera can have, not larger than what image files may be.
[[nodiscard]] inline bool possible_side(double side) { return side >= 1 && side <= 65536; }

/// Counts over all images of a dataset.
struct ReaderNotes {
  std::size_t images = 0;
  std::size_t sixteen_bit = 0;
  std::size_t turned = 0;      ///< by their Exif orientation, because the camera is for the turned image
  std::size_t not_turned = 0;  ///< carry an orientation, but the camera is for the stored image
  std::size_t missing = 0;     ///< images of the file that are not there
  std::string first_missing;
  std::string unread;       ///< the file of the first one in a format that is not read; empty: there is none
  std::size_t odd = 0;      ///< images whose intrinsics no ordinary camera has
  std::string first_odd;    ///< what they are
  double displacement = 0;  ///< largest of all lenses, delivered pixels
  std::size_t fisheyes = 0;
  std::set<std::array<int, 4>> scaled;   ///< camera size, image size
  std::set<std::array<int, 4>> assumed;  ///< the same where the file does not give the camera's size

  // The last lens measured: views that share a camera come one after the other as a rule.
  Lens last_lens;
  Camera<double> last_camera;
  double last_displacement = 0;

  [[nodiscard]] std::string unread_text() const {
    return unread.empty() ? "" : " (" + unread + " is there, but only PNG and JPEG are read)";
  }
};

/// Records intrinsics that are most likely in another unit, or for images of another size: a field of view above 169 or
/// below 0.6 degrees, pixels twice as high as wide, or a principal point near or beyond the border (which a crop may
/// have).
inline void look_at_intrinsics(const View& view, const Camera<double>& c, ReaderNotes& notes) {
  const auto focal = [](double f, int side) { return f >= 0.05 * side && f <= 100.0 * side; };
  const auto middle = [](double p, int side) { return p >= 0.05 * side && p <= 0.95 * side; };
  if (focal(c.fx, c.width) && focal(c.fy, c.height) && c.fx <= 2 * c.fy && c.fy <= 2 * c.fx && middle(c.cx, c.width) &&
      middle(c.cy, c.height))
    return;
  if (notes.odd++ > 0) return;
  std::ostringstream text;
  text << "\"" << view.name << "\", has focal lengths " << c.fx << " and " << c.fy << " and the principal point "
       << c.cx << ", " << c.cy << " for " << c.width << " x " << c.height << " pixels";
  notes.first_odd = text.str();
}

/// Reads the header of view.image_path. The intrinsics are for images of `camera_width` x `camera_height`, 0 where that
/// is not known. Structure from motion reads pixels as they are stored and ignores the orientation; an image is turned
/// only if its camera is for the turned one.
[[nodiscard]] inline Result<ImageInfo> look_at_image(View& view, int camera_width, int camera_height,
                                                     ReaderNotes& notes) {
  Result<ImageInfo> info = read_image_info(view.image_path);
  if (!info) return info.error();
  ++notes.images;
  if (info->bits == 16) ++notes.sixteen_bit;
  // A scaled copy has the same proportions up to one pixel on either side of the smaller size: who made it rounded
  // the width or the height, and the camera may be for the smaller images.
  const auto fits = [&](int width, int height) {
    const double apart = static_cast<double>(camera_height) * width - static_cast<double>(height) * camera_width;
    return std::abs(apart) <= std::max({width, height, camera_width, camera_height});
  };
  if (info->orientation != 1) {
    const bool turn = exchanges_sides(info->orientation) && camera_width > 0 && !fits(info->width, info->height) &&
                      fits(info->height, info->width);
    ++(turn ? notes.turned : notes.not_turned);
    if (turn) {
      view.orientation = info->orientation;
      std::swap(info->width, info->height);
    }
  }
  if (camera_width > 0 && !fits(info->width, info->height)) {
    return Error{ErrorKind::invalid, view.image_path.string(), "image size",
                 "is " + std::to_string(info->width) + " x " + std::to_string(info->height) +
                     ", but its camera is for " + std::to_string(camera_width) + " x " + std::to_string(camera_height) +
                     ", which has other proportions",
                 "use the images the cameras were computed from, scaled but neither cropped nor rotated"};
  }
  if (camera_width > 0 && (info->width != camera_width || info->height != camera_height))
    notes.scaled.insert({camera_width, camera_height, info->width, info->height});
  view.has_alpha = info->has_alpha();
  view.file_width = info->width;
  view.file_height = info->height;
  return info;
}

/// The view's camera at the size it is delivered in, and its lens.
inline void place_camera(View& view, const Camera<double>& intrinsics, const Lens& lens,
                         const DatasetSettings& settings, ReaderNotes& notes) {
  look_at_intrinsics(view, intrinsics, notes);
  const ImageSize size = scaled_size(view.file_width, view.file_height, settings.downscale, settings.max_width);
  view.camera = intrinsics.resized(size.width, size.height);
  view.lens = lens;
  view.lens_treatment = LensTreatment::ignore;
  if (is_pinhole(lens)) return;
  const Camera<double>& c = view.camera;
  const Camera<double>& o = notes.last_camera;
  if (!(lens == notes.last_lens && c.width == o.width && c.height == o.height && c.fx == o.fx && c.fy == o.fy &&
        c.cx == o.cx && c.cy == o.cy)) {
    notes.last_displacement = lens_displacement(c, lens);
    notes.last_lens = lens;
    notes.last_camera = c;
  }
  notes.displacement = std::fmax(notes.displacement, notes.last_displacement);
  if (is_fisheye(lens.model)) ++notes.fisheyes;
  // A quarter pixel is below what the reconstruction resolves, and resampling would cost more sharpness than it gains.
  if (settings.lens != LensTreatment::undistort || notes.last_displacement > 0.25) view.lens_treatment = settings.lens;
}

/// Every n-th view is a test view. Where that would leave nothing to train on, all views train.
inline void split_views(Dataset& dataset, int test_every) {
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    const bool test = test_every > 0 && i % static_cast<std::size_t>(test_every) == 0;
    dataset.views[i].split = test ? Split::test : Split::train;
  }
  if (!dataset.views.empty() && dataset.indices(Split::train).empty()) {
    for (View& view : dataset.views) view.split = Split::train;
    dataset.warnings.push_back(dataset.root.string() + ": too few images for test views, all are used for training");
  }
}

/// Adds the sentences for the user. `source` names the file the cameras come from.
inline void say_notes(const ReaderNotes& notes, const std::string& source, LensTreatment treatment, Dataset& dataset) {
  const auto say = [&](const std::string& sentence) { dataset.warnings.push_back(source + ": " + sentence); };
  const std::string of = " of " + std::to_string(notes.images) + " images ";
  if (notes.missing > 0) {
    say(std::to_string(notes.missing) + " of " + std::to_string(notes.missing + notes.images) +
        " images are missing and left out, the first is \"" + notes.first_missing + "\"" + notes.unread_text());
  }
  const auto left = [](std::size_t named, std::size_t all) {
    return all > named ? "; so are those of " + std::to_string(all - named) + " other sizes" : std::string();
  };
  std::size_t named = 0;
  for (const auto& [width, height, to_width, to_height] : notes.scaled) {
    if (++named > 4) break;
    say("images of " + std::to_string(to_width) + " x " + std::to_string(to_height) + " pixels belong to cameras for " +
        std::to_string(width) + " x " + std::to_string(height) + "; intrinsics are scaled" +
        (named == 4 ? left(named, notes.scaled.size()) : ""));
  }
  named = 0;
  for (const auto& [width, height, to_width, to_height] : notes.assumed) {
    if (++named > 4) break;
    say("w or h is missing, and the images found are smaller copies of " + std::to_string(to_width) + " x " +
        std::to_string(to_height) + " pixels; from the rest of the file the intrinsics are taken to be for " +
        std::to_string(width) + " x " + std::to_string(height) + (named == 4 ? left(named, notes.assumed.size()) : ""));
  }
  if (notes.odd > 0) {
    say("the intrinsics of " + std::to_string(notes.odd) + of + "are unusual: the first, " + notes.first_odd +
        "; check their units, and the size that they are for");
  }
  if (notes.sixteen_bit > 0)
    say(std::to_string(notes.sixteen_bit) + of + "have 16 bits a channel, of which the upper 8 are used");
  if (notes.turned > 0)
    say(std::to_string(notes.turned) + of + "are turned by their Exif orientation, as their cameras are");
  if (notes.not_turned > 0) {
    say(std::to_string(notes.not_turned) + of +
        "carry an Exif orientation, but are used as stored, as their cameras are");
  }
  if (notes.displacement > 0) {
    const std::string much = "the lens moves pixels by at most " + two_digits(notes.displacement);
    say(much + (treatment == LensTreatment::keep     ? "; images keep it"
                : treatment == LensTreatment::ignore ? "; it is ignored, so corners will be blurred"
                : notes.displacement <= 0.25         ? "; it is treated as a pinhole"
                                                     : "; it is taken out when images are loaded"));
  }
}

}  // namespace detail
}  // namespace compmark
