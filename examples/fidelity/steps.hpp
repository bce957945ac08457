// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the cells of a run are made of: an owner's key, trainings, measurements. FunctionSteps does it with the functions
// of compmark/app; the order in which steps are taken, and what is done when one fails, does not depend on them.
#pragma once

#include "cell.hpp"
#include "compmark/core/result.hpp"

namespace fidelity {

/// A part of a cell or of a curve, which is begun again where it was stopped.
enum class Step {
  train_marked,    ///< a model for a codec, and a message in it
  train_coded,     ///< the same without a message
  compress,        ///< a file of what was trained so for another codec (training_of)
  train_unmarked,  ///< a model without a codec, in unmarked_folder()
  fit_codec,       ///< the codec of a cell, to that model
  embed,           ///< a message in the model of the codec's file
  evaluate         ///< the figures of the cell's models
};
/// As the program calls it, and the text file that has what is said of it.
[[nodiscard]] inline const char* step_name(Step step) {
  switch (step) {
    case Step::train_marked:
    case Step::train_coded:
      return "train";
    case Step::compress:
      return "compress";
    case Step::train_unmarked:
      return "host";
    case Step::fit_codec:
      return "fit-codec";
    case Step::embed:
      return "embed";
    case Step::evaluate:
      break;
  }
  return "evaluate";
}

class Steps {
 public:
  Steps() = default;
  Steps(const Steps&) = delete;
  Steps& operator=(const Steps&) = delete;
  virtual ~Steps() = default;

  /// Whether the words of the settings are right for this step. Looks at no file.
  [[nodiscard]] virtual Result<Done> check(Step step, const Cell& cell, const Settings& settings) const = 0;
  /// Writes the owner's key of all cells.
  [[nodiscard]] virtual Result<Done> make_key(const Settings& settings) const = 0;
  /// Takes the step, with `folder` for the cell; false: it was stopped.
  [[nodiscard]] virtual Result<bool> take(Step step, const Cell& cell, const Settings& settings,
                                          const fs::path& folder) const = 0;
};

/// With the functions of compmark/app. What they tell goes to stderr, as from the tool; the figures at their end go to
/// a text file in the folder (step_name).
class FunctionSteps final : public Steps {
 public:
  [[nodiscard]] Result<Done> check(Step step, const Cell& cell, const Settings& settings) const override;
  [[nodiscard]] Result<Done> make_key(const Settings& settings) const override;
  [[nodiscard]] Result<bool> take(Step step, const Cell& cell, const Settings& settings,
                                  const fs::path& folder) const override;
};

}  // namespace fidelity
