// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The options of the commands that train, each bound to the settings of its function. The commands themselves have
// them, and programs that call the functions and take a command's words from their user (examples/fidelity).
#pragma once

#include <compmark/app/run/embed.hpp>
#include <compmark/app/run/fit_codec.hpp>
#include <compmark/app/run/train.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <string>

#include "common.hpp"
#include "options.hpp"
#include "run_options.hpp"
#include "run_telling.hpp"

namespace tool {

struct TrainOptions {
  compmark::TrainSceneSettings settings;
  RunOptions run;
  std::string preset;      ///< of presets.hpp, or none
  std::string background;  ///< black, white, or empty
  std::string lens = "undistort";
};
struct EmbedOptions {
  compmark::EmbedSettings settings;
  RunOptions run;
  std::string distortion = "round";
  std::string method = "compmark";
};
struct FitCodecOptions {
  compmark::FitCodecSettings settings;
  RunOptions run;
};

/// Declares the options of a command, which write into `options`: it must live as long as `app`.
void bind_options(Options& app, TrainOptions& options);
/// Those of a training that has a splat file in place of photographs.
void bind_adopt_options(Options& app, TrainOptions& options);
void bind_options(Options& app, EmbedOptions& options);
void bind_options(Options& app, FitCodecOptions& options);

/// Error: an option was given by hand for which the others leave no use. Programs that set the others themselves do
/// without it.
[[nodiscard]] compmark::Result<compmark::Done> check_given(const Options& app, const TrainOptions& options);
template <class Bound>
[[nodiscard]] compmark::Result<compmark::Done> check_given(const Options& /*app*/, const Bound& /*options*/) {
  return compmark::Done{};
}

/// After the words were parsed: the settings that follow from several of them, or from a name. Error: no such name.
[[nodiscard]] compmark::Result<compmark::Done> complete(const Options& app, TrainOptions& options);
[[nodiscard]] compmark::Result<compmark::Done> complete(const Options& app, EmbedOptions& options);
[[nodiscard]] compmark::Result<compmark::Done> complete(const Options& app, FitCodecOptions& options);

/// Runs the function of a command, one of compmark/app/run, on --threads, and shows it. Returns the exit code.
template <class Bound, class Function>
int show_command(const Options& app, Bound& options, Function function) {
  if (const compmark::Result<compmark::Done> right = check_given(app, options); !right) return fail(right.error());
  if (const compmark::Result<compmark::Done> completed = complete(app, options); !completed)
    return fail(completed.error());
  compmark::ThreadExecutor executor(options.run.threads);
  tell_threads(executor, options.run.threads);
  RunTelling telling(options.settings.out, options.run.json_log, options.settings.resume);
  return telling.finish(function(options.settings, executor, telling));
}

}  // namespace tool
