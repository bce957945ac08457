// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Models of one scene side by side: before and after each codec, marked and not, over the same views.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "compmark/app/compiled.hpp"
#include "compmark/app/compress.hpp"
#include "compmark/app/evaluate.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/watermark/proof/message.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// Errors name these fields as the tool's options do ("--unmarked").
struct CompareSettings {
  std::vector<std::filesystem::path> models;  ///< the first is what the others are compared with
  /// Counterparts without a mark: none, one for all models, or one for each in their order, so that a compressed model
  /// is compared with what the same codec makes of the unmarked one. One may be among the models.
  std::vector<std::filesystem::path> unmarked;
  std::filesystem::path key, decoder;  ///< whose message is read, and by what; both or none
  std::size_t recipient = 0;           ///< whose copy the model is, where the key has recipients
  std::filesystem::path interference;  ///< file of what the scene says by itself, which is subtracted; may be empty
  std::filesystem::path data;
  Split split = Split::test;
  double downscale = 1;
  std::vector<std::string> attacks;  ///< on pictures: "jpeg:50" (watermark/attack); what is read after each by itself
  EvaluateSettings evaluate;
};

/// What a mark, and whatever was done since, changed in a view: this model's render against its unmarked counterpart's,
/// over all pixels.
struct AgainstUnmarked {
  double psnr = 0;  ///< dB
  double ssim = 0;
  std::optional<double> lpips_alex, lpips_squeeze;
};

/// What was read of all views after an attack on each.
struct ReadAfterAttack {
  std::string attack;
  Verification verification;
  /// Mean over the views, dB, of attacked to unattacked renders in 8 bits; none where the picture has another size.
  std::optional<double> psnr;
};

struct ComparedModel {
  std::filesystem::path path;
  std::string name;          ///< of the file, with as many folders as tell it from the others
  bool is_unmarked = false;  ///< the counterpart of a model
  std::uint64_t bytes = 0;   ///< of the file
  std::string codec;         ///< empty: not compressed
  SectionBytes sections;     ///< of a compressed file, largest first
  std::size_t anchors = 0;
  Evaluation evaluation;
  std::optional<Verification> verification;
  std::vector<ReadAfterAttack> attacked;          ///< of CompareSettings::attacks, in their order; empty without a key
  std::optional<std::size_t> unmarked;            ///< its counterpart, in Comparison::models
  std::vector<AgainstUnmarked> against_unmarked;  ///< of every view; empty without a counterpart
};

struct Comparison {
  std::vector<ComparedModel> models;  ///< in the order they were given, then the unmarked ones that are none of them
  Split split = Split::test;
  Message message;  ///< of the key; empty without one
};

/// Told while models are measured, in the order of Comparison::models. What is not overridden is not told.
struct CompareObserver {
  virtual ~CompareObserver() = default;
  virtual void on_warning(const std::string& /*sentence*/) {}  ///< of the dataset, each once
  virtual void on_model(const std::filesystem::path& /*path*/, std::size_t /*view_count*/) {}  ///< its views follow
  /// False stops: ErrorKind::cancelled.
  virtual bool on_view(const SeenView& /*view*/) { return true; }
};

/// Loads, renders and measures every model. Cost: a render a view and model, and as many of the unmarked ones, whose
/// photographs stay in memory together; an attack and a reading for each view, model and attack. Error: an attack that
/// PictureAttacks does not name, attacks without a key, a picture that an attack leaves too small to be read.
[[nodiscard]] Result<Comparison> compare_models(const CompareSettings& settings, ThreadExecutor& executor,
                                                CompareObserver& observer);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/compare.hpp"
#endif
