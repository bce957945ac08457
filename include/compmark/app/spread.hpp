// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Spread-spectrum marks in files (watermark/spread/spread_mark.hpp): marking a model, and reading pictures whose camera
// is known, by the unmarked model. Nothing is learned, so that a mark takes seconds; it holds no message, but that the
// key is there. Whoever reads needs the unmarked model as it was marked, to the byte or nearly so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/watermark/proof/spread_evidence.hpp"
#include "compmark/watermark/spread/spread_mark.hpp"

namespace compmark {

/// Decibels between renders that a spread mark may have.
inline constexpr double least_spread_psnr = 30, largest_spread_psnr = 80;
/// An error of `option` if a spread mark cannot have these decibels.
[[nodiscard]] inline Result<Done> check_spread_psnr(double psnr, const char* option) {
  if (psnr >= least_spread_psnr && psnr <= largest_spread_psnr) return Done{};
  return Error{
      ErrorKind::invalid, {}, option, "is not between 30 and 80 dB", "50 is seen by nobody, and proven by one picture"};
}

/// Errors name these fields as the tool's options do ("--model").
struct SpreadMarkSettings {
  std::filesystem::path model;  ///< model.safetensors of any recipe whose anchors have features
  std::filesystem::path out;    ///< the marked one
  double psnr = 50;             ///< between renders of the two, over training views, 30 to 80 dB
};

struct SpreadMarked {
  double psnr = 0;        ///< that was reached
  double strength = 0;    ///< length that a feature was moved by
  std::size_t cells = 0;  ///< cubes, of one sign each
  double cell_side = 0;   ///< units of the model
};

/// Side of the cubes of spread marks in a model, units of the model: what its file says (ModelInfo::spread_side), or 8
/// pixels in the median over anchors and training views. A file with fewer cameras or anchors than the model that is
/// marked (a .cmk) would give another side, and with it other cubes: it has to say it. Error: no cameras, or no anchor.
[[nodiscard]] Result<double> spread_cell_side(AnyModel& model);

/// Has the compressed file of a model that gets a spread mark say which cubes the mark has (META.spread_side), so that
/// pictures are read by that file as by the model. Error: one of spread_cell_side.
[[nodiscard]] Result<Done> store_spread_side(AnyModel& unmarked, CodecModel& coded);

/// Marks a model. Error: too few anchors for evidence, or no features. Cost: 30 forward and backward passes, then 72
/// renders.
[[nodiscard]] Result<SpreadMarked> mark_spread(const OwnerKey& key, const SpreadMarkSettings& settings,
                                               ThreadExecutor& executor, const WorkObserver& observer = {});

/// Reads pictures by an unmarked model. Nothing here knows a key: it gives what a picture says of each cell, and the
/// evidence of a key is made of that.
class SpreadReader {
 public:
  /// The model stays with the caller, and is not moved. Cost: 30 forward and backward passes.
  [[nodiscard]] static Result<SpreadReader> make(AnyModel& unmarked, ThreadExecutor& executor);

  /// ADDS what a picture [3, height, width] says. `render` is that of the unmarked model at `camera`, of the picture's
  /// size, with the picture's colours; `weight` [height, width] is 0 where the picture shows something else.
  /// Returns the blur that made the render as soft as the picture, pixels.
  [[nodiscard]] Result<double> add(ImageView<const float> picture, ImageView<const float> render,
                                   std::span<const float> weight, const Camera<double>& camera,
                                   ThreadExecutor& executor, std::span<double> sums);

  [[nodiscard]] const SpreadCells& cells() const { return cells_; }
  [[nodiscard]] double cell_side() const { return side_; }
  [[nodiscard]] MatrixView<const float> direction() const { return {direction_.data(), rows_, columns_}; }

 private:
  explicit SpreadReader(AnyModel& model) : model_(&model) {}

  AnyModel* model_;
  SpreadCells cells_;
  double side_ = 0;
  std::vector<float> direction_;  ///< [anchors, features], rows of length 1
  std::size_t rows_ = 0, columns_ = 0;
};

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/spread.hpp"
#endif
