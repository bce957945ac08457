// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// results.json: the results of a run for other programs. The names, their order and their types are a contract
// (docs/results.md); a change of meaning raises `schema`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/splat/quantizer/concept.hpp"

namespace compmark {

/// Means over the test views, on images rounded to 8 bits.
struct TestMetrics {
  double psnr = 0;  ///< dB
  double ssim = 0;
  std::optional<double> lpips_alex;  ///< null in the file when no weights were given
  int views = 0;
  std::optional<double> psnr_colour_fitted{};  ///< dB; only of models with an exposure
};

/// The reading of a marked model's renders.
struct WatermarkMetrics {
  double mean = 0;  ///< share of the bits that are right, mean over the views
  double min = 0;   ///< in the worst view
  int views = 0;
  double p_value = 1;               ///< of all views together
  double largest_view_p_value = 1;  ///< of the worst view by itself
  std::optional<double>
      psnr_cost_vs_unmarked;  ///< dB, the counterpart's test PSNR minus this model's; null without a counterpart, or photographs
  std::optional<double> psnr_marked_vs_unmarked;  ///< dB, of the renders of both
};

/// The same model from its compressed file.
struct CompressedMetrics {
  std::string codec;
  std::uint64_t bytes = 0;  ///< of the whole file
  std::uint64_t anchors = 0;
  double encode_seconds = 0;
  double decode_seconds = 0;  ///< from opening the file to a model that renders
  TestMetrics test;           ///< over the training views where there are no test views; null in the file then
  std::optional<WatermarkMetrics> watermark;
  std::vector<std::pair<std::string, std::uint64_t>> sections;  ///< bytes by what they are for
};

struct RunResults {
  std::string dataset;  ///< last name of the path that was given
  std::string recipe;
  std::string profile;
  std::int64_t iterations = 0;  ///< finished
  std::uint64_t seed = 0;
  int threads = 0;
  std::uint64_t anchors = 0;
  double gaussians_per_view = 0;                ///< mean over the test views (training views where there are none)
  double train_seconds = 0;                     ///< wall clock, over all sessions of a resumed run
  double peak_memory_mb = 0;                    ///< resident, 10^6 bytes
  std::optional<TestMetrics> test;              ///< null when the data set has no test views
  std::string model_sha256;                     ///< of RUN/model.safetensors
  std::uint64_t revivals = 0;                   ///< opacities were set anew; in the file above 0 alone
  std::optional<StepSummary> distortion_step;   ///< of the distortion layer in the last iteration
  std::optional<double> rate_lambda;            ///< of a run for a codec
  std::vector<std::string> effects;             ///< names of the scene effects that the recipe models
  std::optional<WatermarkMetrics> watermark;    ///< not in the file of an unmarked run
  std::string method;                           ///< of a mark in a finished model (embed_method.hpp); else empty
  std::optional<CompressedMetrics> compressed;  ///< not in the file of a run without a codec
  std::string identity;                         ///< JSON: the settings of the run, and digests of the files it read
};

[[nodiscard]] Result<Done> write_results(const std::filesystem::path& path, const RunResults& results);
/// Error: the file is missing, is none of these, or is of another schema.
[[nodiscard]] Result<RunResults> read_results(const std::filesystem::path& path);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/run_results.hpp"
#endif
