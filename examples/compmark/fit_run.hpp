// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Fits a message decoder to one scene and writes it: compmark fit, and the fit of embed and train without a decoder.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/watermark/fit/decoder_fit_settings.hpp>
#include <cstddef>
#include <filesystem>
#include <string>

namespace tool {

struct FitOptions {
  std::filesystem::path model, data;  ///< unmarked; the dataset it was trained on
  std::filesystem::path out, json;    ///< json may be empty: as out, with another ending
  /// Numbers of 0 are chosen from the bits and the size of the images; coordinates below 0 from the number of features.
  compmark::DecoderFitSettings fit{.waves = 0, .stride = 0, .statistics_views = 0, .coordinates = -1};
  bool force = false;  ///< over a decoder that is there
  double downscale = 1;
  std::size_t threads = 0;
};

struct FittedFile {
  std::string sha256;
  double wave_agreement = 0, agreement = 0, noise_ratio = 0, seconds = 0;
};

/// Writes options.out and options.json.
compmark::Result<FittedFile> fit_to_file(FitOptions options);

}  // namespace tool
