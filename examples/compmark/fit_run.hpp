// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder for one scene, into a file: what compmark fit does, and embed and train where no decoder is given.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/pipeline/decoder_fit_settings.hpp>
#include <cstddef>
#include <filesystem>
#include <string>

namespace tool {

struct FitOptions {
  std::filesystem::path model, data;  ///< unmarked; the dataset it was trained on
  std::filesystem::path out, json;    ///< json may be empty: as out, with another ending
  /// Numbers of 0 are chosen by the bits and the images' size; coordinates below 0 by the waves.
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
