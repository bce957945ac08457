// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decides what the numbers in the masks of a capture mean. Usually black is ignored, white counts, and a level between
// is a weight. But masks are also written as 0 and 1 (not 0 counts), as labels, with the colours of a palette, with 16
// bits, or in the alpha channel of an image of one colour. All masks of a capture are examined together, because a
// single one may be all black or all white. A reading other than by levels is reported. Views without a counting pixel
// are left out; a capture without one is refused. Cost: decodes every mask once.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/mask_file.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {
namespace detail {

/// A mask whose brightest pixel is below this share of white holds labels, or 0 and 1, and no soft weights.
inline constexpr double dark_mask = 0.25;

/// What one channel of a mask holds.
struct MaskLevels {
  double least = 1, most = 0;  ///< of white
  std::set<int> levels;        ///< those that are not 0, the first three of them

  void add(int value, int white) {
    const double v = static_cast<double>(value) / white;
    least = std::min(least, v);
    most = std::max(most, v);
    if (value > 0 && levels.size() < 3) levels.insert(value);
  }
  [[nodiscard]] bool constant() const { return least == most; }
};

/// What one mask holds.
struct MaskFacts {
  int width = 0, height = 0;
  MaskLevels color, alpha;
  bool has_alpha = false, sixteen_bit = false;
  bool colored = false;    ///< some pixel is no grey
  bool one_color = true;   ///< all pixels have one colour
  bool disagree = false;   ///< alpha and colour ignore different pixels
  std::size_t colors = 0;  ///< different ones, at most 257
};

[[nodiscard]] inline MaskFacts mask_facts(const MaskFile& mask) {
  MaskFacts facts;
  facts.width = mask.width;
  facts.height = mask.height;
  facts.has_alpha = mask.has_alpha();
  facts.sixteen_bit = mask.white != 255;
  std::set<std::uint64_t> colors;
  std::uint64_t last = ~std::uint64_t{0};
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const int value = mask.value(i);
    // A twentieth of white: more than the rounding of a JPEG adds to a grey.
    facts.colored = facts.colored || 20 * (value - mask.darkest(i)) > mask.white;
    const std::uint16_t* p = mask.pixels.data() + i * static_cast<std::size_t>(mask.channels);
    const std::uint64_t color = mask.channels < 3 ? p[0] : p[0] | std::uint64_t{p[1]} << 16 | std::uint64_t{p[2]} << 32;
    const int alpha = facts.has_alpha ? mask.alpha(i) : mask.white;
    facts.disagree = facts.disagree || (value > 0) != (alpha > 0);
    if (color != last && colors.size() <= 256) colors.insert(color);
    last = color;
    facts.color.add(value, mask.white);
    facts.alpha.add(alpha, mask.white);
  }
  facts.colors = colors.size();
  facts.one_color = colors.size() <= 1;
  return facts;
}

/// The meaning of the masks of a capture, with a sentence for the user if it is not the ordinary one.
struct MaskDecision {
  MaskReading reading = MaskReading::level;
  std::string sentence;
};

/// An Error, without its file, if the masks cannot be understood.
[[nodiscard]] inline Result<MaskDecision> decide_masks(const std::map<std::filesystem::path, MaskFacts>& masks) {
  const auto fail = [](const std::filesystem::path& mask, std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, mask.string(), "mask", std::move(problem), std::move(remedy)};
  };
  constexpr const char* plain = "write masks in grey, black where a pixel is to be ignored and white where it counts";
  bool in_alpha = false, in_color = false;
  for (const auto& [path, facts] : masks) {
    const bool varies = facts.has_alpha && !facts.alpha.constant();
    if (varies && !facts.one_color && facts.disagree)
      return fail(path, "has colours and an alpha channel that ignore different pixels", plain);
    in_alpha = in_alpha || varies;
    in_color = in_color || (!facts.one_color && !varies);
  }
  if (in_alpha && in_color) {
    for (const auto& [path, facts] : masks) {
      if (facts.has_alpha && !facts.alpha.constant() && facts.disagree)
        return fail(path, "is a mask in its alpha channel, while others are in their colours", plain);
    }
    in_alpha = false;
  }
  MaskLevels all;
  std::set<double> levels;
  bool colored = false;
  const std::filesystem::path* first_colored = nullptr;
  for (const auto& [path, facts] : masks) {
    const MaskLevels& one = in_alpha && facts.has_alpha ? facts.alpha : facts.color;
    all.least = std::min(all.least, one.least);
    all.most = std::max(all.most, one.most);
    for (const int level : one.levels) levels.insert(static_cast<double>(level) / (facts.sixteen_bit ? 65535 : 255));
    if (in_alpha || !facts.colored) continue;
    if (facts.colors > 256) return fail(path, "has more than 256 colours, so it is a photograph and no mask", plain);
    if (first_colored == nullptr) first_colored = &path;
    colored = true;
  }
  if (all.most == 0) {
    return fail(masks.begin()->first,
                masks.size() == 1 ? "is black everywhere, so that no pixel counts"
                                  : "is black everywhere, as are all " + std::to_string(masks.size()) +
                                        " masks, so that no pixel counts",
                "make white what counts, or remove the masks");
  }
  if (colored && all.least > 0)
    return fail(*first_colored,
                "has colours, and no pixel of any mask is black, so it is not known what is to be ignored", plain);
  // Labels and counts stay small; a soft edge of a mask has a white side. A single level beside black is what counts,
  // whatever its number.
  const bool any = colored || all.most < dark_mask || (levels.size() == 1 && all.most < 1);
  MaskDecision decision;
  decision.reading = any ? (in_alpha ? MaskReading::any_alpha : MaskReading::any)
                         : (in_alpha ? MaskReading::alpha : MaskReading::level);
  if (in_alpha) decision.sentence = "masks are in the alpha channels of their files";
  if (any) {
    decision.sentence += decision.sentence.empty() ? "" : "; ";
    decision.sentence += (colored ? "masks have colours" : "no mask has a white pixel");
    decision.sentence += ", so all that is not black counts whole";
  }
  return decision;
}

/// Decides how the masks of a dataset are read, and leaves out views of which nothing counts.
[[nodiscard]] inline Result<Done> read_masks(Dataset& dataset) {
  std::map<std::filesystem::path, MaskFacts> masks;
  for (const View& view : dataset.views) {
    if (view.mask_path.empty() || masks.count(view.mask_path) > 0) continue;
    const Result<MaskFile> mask = read_mask_file(view.mask_path);
    if (!mask) return mask.error();
    const bool upright = mask->width == view.file_width && mask->height == view.file_height;
    if (!upright && (view.orientation == 1 || mask->width != view.file_height || mask->height != view.file_width))
      return mask_of_other_size(view, mask->width, mask->height, view.file_width, view.file_height);
    masks.emplace(view.mask_path, mask_facts(*mask));
  }
  if (masks.empty()) return Done{};
  const Result<MaskDecision> decision = decide_masks(masks);
  if (!decision) return decision.error();
  const auto say = [&](const std::string& sentence) {
    dataset.warnings.push_back(dataset.root.string() + ": " + sentence);
  };
  if (!decision->sentence.empty()) say(decision->sentence);
  const bool alpha = decision->reading == MaskReading::alpha || decision->reading == MaskReading::any_alpha;
  const bool any = decision->reading == MaskReading::any || decision->reading == MaskReading::any_alpha;
  const bool had_tests = !dataset.indices(Split::test).empty();
  std::vector<View> kept;
  std::size_t empty = 0, dark = 0;
  std::string first_name, first_mask, first_dark;
  for (View& view : dataset.views) {
    view.mask_reading = decision->reading;
    if (!view.mask_path.empty()) {
      const MaskFacts& facts = masks.at(view.mask_path);
      const double most = (alpha && facts.has_alpha ? facts.alpha : facts.color).most;
      if (most == 0) {
        if (empty++ == 0) first_name = view.name, first_mask = view.mask_path.string();
        continue;
      }
      if (!any && most < dark_mask) {
        view.mask_reading = alpha ? MaskReading::any_alpha : MaskReading::any;
        if (dark++ == 0) first_dark = view.name;
      }
    }
    kept.push_back(std::move(view));
  }
  dataset.views = std::move(kept);
  if (dataset.indices(Split::train).empty()) {
    return Error{ErrorKind::invalid, first_mask, "mask",
                 "is black everywhere, as are those of all training images, so that no pixel counts",
                 "make white what counts, or remove the masks"};
  }
  if (dark > 0) {
    say(std::to_string(dark) +
        " masks have no white pixel, while others have, so all that is not black in them counts whole, the first is of "
        "\"" +
        first_dark + "\"");
  }
  if (empty > 0) {
    say(std::to_string(empty) + " images are left out, as their masks are black everywhere, the first is \"" +
        first_name + "\"" + (had_tests && dataset.indices(Split::test).empty() ? "; so there are no test views" : ""));
  }
  return Done{};
}

}  // namespace detail
}  // namespace compmark
