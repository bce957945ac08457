// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What an attack costs a mark, and what it costs the thief: renders of a marked model after one attack, read blind and,
// with the unmarked model, by informed reading, beside their PSNR to the renders before it. Every cell stands by itself
// and is the same whenever it is measured (docs/robustness.md; examples/reproduce_robustness.cpp makes tables of them).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compiled.hpp"
#include "compmark/app/reading.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// Errors name these fields as the program's options do ("--model").
struct RobustnessSettings {
  std::filesystem::path model;  ///< marked
  std::filesystem::path key, decoder;
  std::size_t recipient = 0;       ///< whose copy the model is, where the key has recipients
  std::filesystem::path unmarked;  ///< for informed reading, and averaging with it; may be empty
  std::filesystem::path
      pictures;           ///< folder for the pictures that informed reading reads: view_<number>.png of the last
                          ///< attack stay there, whatever else is in it is left alone
  std::size_t views = 8;  ///< read blind, evenly spaced among the cameras of the test; 0: all
  std::size_t informed_views = 1;  ///< of those, pictures that are read informed, with unknown camera
  std::uint64_t seed = 0;          ///< of the attacks; pictures have seed + number of the view
  bool pruned = false;    ///< attacked models are also read as lacking anchors (verify_pruned), which is four tests
  bool restored = false;  ///< attacked models are also read put back together in `unmarked` (ReadingSettings::restored)
};

/// What is done. The texts are those of cells in files: "jpeg:50", "lightgaussian:0.66", "pgd:0.1".
enum class RobustnessKind : std::uint8_t {
  none,     ///< the renders as they are
  picture,  ///< an attack of PictureAttacks on every render
  model,    ///< one of ModelAttacks on the model
  pgd,      ///< "pgd:EPSILON" away from what is read; "pgd_random:EPSILON" to another message; "pgd_no_key:EPSILON"
            ///< through the decoder with the carriers of another key
  average,  ///< with the models of `files`
  other     ///< the first of `files` in place of the model: marked again, trained on, compressed
};
struct RobustnessAttack {
  RobustnessKind kind = RobustnessKind::none;
  std::string text = {};  ///< of `average` and `other` a name
  std::vector<std::filesystem::path> files = {};
};

/// What was read of an attacked model in the unmarked one: a reading of its own, of one test.
struct RestoredCell {
  double mean = 0, worst = 0;  ///< share of the bits, in a view
  std::size_t matches = 0;     ///< of all views together
  double p_value = 1;          ///< of all views together
  RestoredFeatures features = {};
};

/// What was read after one attack. p-values are corrected for the readings of a model (RobustnessSettings::pruned).
struct RobustnessCell {
  std::size_t views = 0, bits = 0;
  double mean = 0, worst = 0;  ///< share of the bits, in a view
  std::size_t matches = 0;     ///< of all views together
  double p_value = 1;          ///< of all views together
  double worst_p_value = 1;    ///< of the worst view
  double missing_share = 0;    ///< of the anchors, that the model was read as lacking
  std::optional<double> psnr;  ///< dB, mean over the views, to the renders before; none where the size is another
  std::size_t informed = 0;    ///< pictures that were read informed; the rest is of them
  std::size_t found = 0;       ///< whose camera was found
  std::size_t informed_matches = 0;
  double spread_deviations = 0;               ///< of a spread mark, in all of them together
  double informed_p_value = 1;                ///< of message and spread mark, corrected: two tests
  std::optional<RestoredCell> restored = {};  ///< none of a picture, and where no anchor is one of the unmarked model's
};

class RobustnessBench {
 public:
  /// Renders what is attacked. Error: a file that cannot be read, a model without cameras, `restored` without the
  /// unmarked model of the scene.
  [[nodiscard]] static Result<RobustnessBench> open(const RobustnessSettings& settings, ThreadExecutor& executor);

  /// Cost: a render and a reading a view, and what the attack takes; informed, up to 10 s a picture.
  [[nodiscard]] Result<RobustnessCell> measure(const RobustnessAttack& attack, ThreadExecutor& executor);

 private:
  using Pictures = std::vector<AttackedPicture>;
  [[nodiscard]] Result<Pictures> renders(AnyModel& model, ThreadExecutor& executor) const;
  /// Of an attack on models.
  [[nodiscard]] Result<AnyModel> attacked_model(const RobustnessAttack& attack, ThreadExecutor& executor) const;
  [[nodiscard]] Result<Pictures> attacked(const RobustnessAttack& attack, double missing_share,
                                          ThreadExecutor& executor);
  [[nodiscard]] Result<RobustnessCell> read_blind(const RobustnessAttack& attack, Pictures& pictures,
                                                  std::uint64_t tests, ThreadExecutor& executor);
  [[nodiscard]] Result<Pictures> pgd(const std::string& text, ThreadExecutor& executor);
  [[nodiscard]] Result<std::vector<ViewLogits>> logits_of(Pictures& pictures, ThreadExecutor& executor);
  [[nodiscard]] Result<std::optional<RestoredCell>> read_restored(const RobustnessAttack& attack,
                                                                  ThreadExecutor& executor);
  [[nodiscard]] Result<Done> read_informed(const Pictures& pictures, ThreadExecutor& executor, RobustnessCell& cell);

  RobustnessSettings settings_;
  OwnerKey key_;
  FileDecoder decoder_;
  FileDecoder::Context context_;
  std::vector<StoredView> views_;
  Pictures before_;
  std::vector<ViewLogits> unmarked_;  ///< what the unmarked model says by itself, of `restored`
};

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/robustness.hpp"
#endif
