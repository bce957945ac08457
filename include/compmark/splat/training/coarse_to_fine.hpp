// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Coarse images first. In the first part of a run a scene has no detail yet, and an iteration at half the size costs a
// quarter of the pixels. So a run may look at its photographs at a fraction of their size first (coarse_images.hpp), and
// at their own size from then on. What a coarse iteration sees of a Gaussian is the box-filtered image of the fine one:
// the camera is that of the coarse pixels, and the blur of the projection stands for the filter (coarse_blur()).
// Thresholds of growing need no change: screen-space gradients are in units of the image, and the loss is a mean over
// its pixels. Cost: a comparison an iteration.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark {

/// Photographs with sides divided by `factor`, up to a share of the run.
struct CoarseLevel {
  int factor = 2;      ///< 2 to CoarseToFine::largest_factor
  double until = 0.5;  ///< share of the run's iterations at which the level ends, above 0 and below 1

  friend bool operator==(const CoarseLevel&, const CoarseLevel&) = default;
};

/// The sizes at which a run looks at its photographs, one after the other.
struct CoarseToFine {
  std::vector<CoarseLevel> levels;  ///< factors fall and shares rise; empty: the photographs' own size from the start

  static constexpr int largest_factor = 16;
  /// Pixels of the shortest side of a coarse image: a tile of the rasterizer, and more than the window of SSIM.
  static constexpr int smallest_side = 16;

  /// That of the coarsest level; 1: there is none.
  [[nodiscard]] int largest() const { return levels.empty() ? 1 : levels.front().factor; }
  /// The factor of 1-based iteration t of a run of `total`; 1 at full size.
  [[nodiscard]] int factor(std::int64_t t, std::int64_t total) const {
    for (const CoarseLevel& level : levels) {
      if (static_cast<double>(t) <= level.until * static_cast<double>(total)) return level.factor;
    }
    return 1;
  }
  /// The last iteration that looks at coarse images; 0: none does.
  [[nodiscard]] std::int64_t last_iteration(std::int64_t total) const {
    return levels.empty() ? 0 : static_cast<std::int64_t>(levels.back().until * static_cast<double>(total));
  }

  friend bool operator==(const CoarseToFine&, const CoarseToFine&) = default;
};

/// Makes a camera that of the coarse image: each of its pixels is `factor` x `factor` of the camera's. What is left
/// over at the right and the lower edge is not seen. A factor of 1 changes nothing.
inline void make_coarse(Camera<double>& camera, int factor) {
  if (factor == 1) return;
  const int width = camera.width / factor, height = camera.height / factor;
  camera = camera.cropped(0, 0, width * factor, height * factor).resized(width, height);
}

/// The blur of a projection, in coarse pixels^2, whose image is that of `blur` (pixels^2) after the box filter: a box
/// of k pixels adds (k^2 - 1) / 12 pixels^2 to the variance of what it averages, and a coarse pixel^2 is k^2 of them.
[[nodiscard]] constexpr double coarse_blur(double blur, int factor) {
  const double squared = static_cast<double>(factor) * factor;
  return (blur + (squared - 1) / 12) / squared;
}

/// An Error if these levels are none.
[[nodiscard]] inline Result<Done> check_coarse_to_fine(const CoarseToFine& coarse) {
  const auto fail = [](std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, {}, "coarse_to_fine", std::move(problem), std::move(remedy)};
  };
  const CoarseLevel* before = nullptr;
  for (const CoarseLevel& level : coarse.levels) {
    if (level.factor < 2 || level.factor > CoarseToFine::largest_factor) {
      return fail("divides the photographs' sides by " + std::to_string(level.factor),
                  "give whole factors from 2 to " + std::to_string(CoarseToFine::largest_factor));
    }
    if (!(level.until > 0 && level.until < 1)) {
      return fail("ends a level at " + std::to_string(level.until) + " of the run",
                  "give a share above 0 and below 1, as the last iterations need the photographs' own size");
    }
    if (before != nullptr && !(level.factor < before->factor && level.until > before->until)) {
      return fail("goes from a factor of " + std::to_string(before->factor) + " until " +
                      std::to_string(before->until) + " to one of " + std::to_string(level.factor) + " until " +
                      std::to_string(level.until),
                  "give coarse levels before fine ones, each with a later end: 4:0.2,2:0.6");
    }
    before = &level;
  }
  return Done{};
}

/// Levels by their text, FACTOR:UNTIL with commas in between: "2:0.6", "4:0.2,2:0.6"; empty: none. An Error names the
/// part that is no level.
[[nodiscard]] inline Result<CoarseToFine> coarse_to_fine_of(std::string_view text) {
  CoarseToFine coarse;
  for (bool more = !text.empty(); more;) {
    const std::size_t comma = text.find(',');
    const std::string_view part = text.substr(0, comma);
    more = comma != std::string_view::npos;
    if (more) text.remove_prefix(comma + 1);
    CoarseLevel level;
    const char* const end = part.data() + part.size();
    auto [place, status] = std::from_chars(part.data(), end, level.factor);
    if (status == std::errc() && place != end && *place == ':') {
      const auto share = std::from_chars(place + 1, end, level.until);
      place = share.ptr;
      status = share.ec;
    } else {
      status = std::errc::invalid_argument;
    }
    if (status != std::errc() || place != end) {
      return Error{ErrorKind::invalid,
                   {},
                   "coarse_to_fine",
                   "\"" + std::string(part.substr(0, 40)) + "\" is no level",
                   "write a factor, a colon and the share of the run at which it ends: 2:0.6"};
    }
    coarse.levels.push_back(level);
  }
  if (Result<Done> fits = check_coarse_to_fine(coarse); !fits) return fits.error();
  return coarse;
}

/// An Error if the image of a camera is too small for a factor above 1. `name` is the view's.
[[nodiscard]] inline Result<Done> check_coarse_size(int factor, const Camera<double>& camera, const std::string& name) {
  const int width = camera.width / factor, height = camera.height / factor;
  if (factor == 1 || std::min(width, height) >= CoarseToFine::smallest_side) return Done{};
  return Error{
      ErrorKind::invalid, name, "coarse_to_fine",
      "makes its photograph of " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
          " pixels one of " + std::to_string(width) + " x " + std::to_string(height),
      "choose a smaller factor: a side has at least " + std::to_string(CoarseToFine::smallest_side) + " pixels"};
}

}  // namespace compmark
