// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is read of a view after attacks on its render (watermark/attack), each by itself.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/detail/reading.hpp"
#include "compmark/app/evaluate.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/watermark/attack/picture_attacks.hpp"

namespace compmark::detail {

/// Whether all attacks are of the list and somebody can read after them: told before anything is rendered.
[[nodiscard]] inline Result<Done> check_attacks(const std::vector<std::string>& attacks,
                                                const std::filesystem::path& key) {
  if (!attacks.empty() && key.empty())
    return Error{ErrorKind::invalid, {}, "--key", "is missing", "what is read after an attack needs a key"};
  for (const std::string& attack : attacks) {
    if (Result<Done> known = check_attack<PictureAttacks>(attack); !known) return known;
  }
  return Done{};
}

/// What was read of the views after one attack, and what it cost the thief.
struct AttackedViews {
  std::vector<ViewLogits> read;
  double psnr = 0;        ///< dB, sum over the views
  bool same_size = true;  ///< of pictures before and after

  [[nodiscard]] std::optional<double> mean_psnr() const {
    if (!same_size || read.empty()) return std::nullopt;
    return psnr / static_cast<double>(read.size());
  }
};

/// Adds to views[a] what is read after attack a on the view's render, in 8 bits, as an image file has it. The attack's
/// seed is the view's number. `reader.read(image, name, executor)` gives the logits.
template <class Reader>
[[nodiscard]] Result<Done> read_after_attacks(const std::vector<std::string>& attacks, const SeenView& view,
                                              Reader& reader, std::vector<AttackedViews>& views,
                                              ThreadExecutor& executor) {
  for (std::size_t a = 0; a < attacks.size(); ++a) {
    Result<AttackedPicture> picture = attack_picture<PictureAttacks>(attacks[a], view.render, view.index);
    if (!picture) return picture.error();
    const ImageView<float> image{picture->planes.data(), 3, picture->height, picture->width};
    round_to_8bit<float>(image, image);
    Result<ViewLogits> logits = reader.read(ImageView<const float>(image), view.result.name, executor);
    if (!logits) {
      Error error = logits.error();
      error.problem = "after " + attacks[a] + ": " + error.problem;
      return error;
    }
    views[a].read.push_back(std::move(*logits));
    views[a].same_size =
        views[a].same_size && picture->height == view.render.height && picture->width == view.render.width;
    if (views[a].same_size) views[a].psnr += psnr(ImageView<const float>(image), view.render);
  }
  return Done{};
}

}  // namespace compmark::detail
