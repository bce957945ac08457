// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The words of the user are read by the tool's own options; what a cell decides is then set in the settings that they
// are bound to.
#include "steps.hpp"

#include <CLI/CLI.hpp>
#include <cerrno>
#include <compmark/app/run/embed.hpp>
#include <compmark/app/run/fit_codec.hpp>
#include <compmark/app/run/train.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../compmark/common.hpp"
#include "../compmark/decoder_choice.hpp"
#include "../compmark/key_making.hpp"
#include "../compmark/machine_memory.hpp"
#include "../compmark/process.hpp"
#include "../compmark/run_folder.hpp"
#include "../compmark/run_telling.hpp"
#include "../compmark/training_options.hpp"
#include "coding.hpp"
#include "curves.hpp"
#include "fitted.hpp"
#include "measure.hpp"
#include "stopping.hpp"

namespace fidelity {
namespace {

using Words = std::vector<std::string>;

/// A command of the tool whose options are bound to settings.
template <class Bound>
struct Command {
  explicit Command(const char* name) : options(*app.add_subcommand(name)) { tool::bind_options(options, bound); }

  CLI::App app{"compmark"};
  tool::Options options;
  Bound bound;
};
template <class Bound>
using Parsed = Result<std::unique_ptr<Command<Bound>>>;

/// `needed` are options that the command must have, `more` those of the user.
template <class Bound>
Parsed<Bound> parse(const char* name, const Words& needed, const Words& more) {
  auto command = std::make_unique<Command<Bound>>(name);
  Words words{name};
  words.insert(words.end(), needed.begin(), needed.end());
  words.insert(words.end(), more.begin(), more.end());
  Words from_end(words.rbegin(), words.rend());  // as the parser takes them
  try {
    command->app.parse(from_end);
  } catch (const CLI::ParseError& error) {
    return tool::words_error(command->app, error, words);
  }
  if (Result<Done> completed = tool::complete(command->options, command->bound); !completed) return completed.error();
  return command;
}

Words data_and_out(const Cell& cell, const fs::path& out) {
  return {"--data", cell.scene.folder.string(), "--out", out.string()};
}
template <class Bound>
void set_common(Bound& bound, const Cell& cell, const Settings& settings) {
  bound.settings.downscale = cell.scene.downscale;
  bound.settings.resume = true;
  bound.run.threads = settings.threads;
}

Parsed<tool::TrainOptions> training(Step step, const Cell& cell, const Settings& settings, const fs::path& folder) {
  const Words given = tool::renamed(settings.extra);
  const bool coded = step != Step::train_unmarked;
  Parsed<tool::TrainOptions> command =
      parse<tool::TrainOptions>("train", data_and_out(cell, coded ? folder : unmarked_folder(cell, settings)),
                                coded ? words_for(cell.codec, given) : divide(given).train);
  if (!command) return command;
  tool::TrainOptions& bound = (*command)->bound;
  set_common(bound, cell, settings);
  bound.settings.iterations = settings.iterations;
  if (coded) {
    bound.settings.codec = cell.codec;
    bound.settings.rate_lambda = settings.rate_lambda;
  } else {
    bound.settings.for_fit_codec = true;
  }
  if (step == Step::train_marked) {
    bound.settings.mark.key = settings.key();
    bound.settings.mark.bits = static_cast<std::size_t>(settings.bits);
    if (settings.universal) {
      if (Result<Done> chosen = tool::choose_decoder(bound.settings.mark); !chosen) return chosen.error();
    }
  }
  return command;
}

Parsed<tool::FitCodecOptions> codec_fit(const Cell& cell, const Settings& settings, const fs::path& folder) {
  Words needed = data_and_out(cell, folder / "unmarked");
  needed.insert(needed.end(), {"--model", (unmarked_folder(cell, settings) / "model.safetensors").string()});
  Parsed<tool::FitCodecOptions> command =
      parse<tool::FitCodecOptions>("fit-codec", needed, divide(tool::renamed(settings.extra)).codec);
  if (!command) return command;
  tool::FitCodecOptions& bound = (*command)->bound;
  set_common(bound, cell, settings);
  bound.settings.codec = cell.codec;
  bound.settings.rate_lambda = settings.rate_lambda;
  bound.settings.iterations = settings.fit_codec;
  return command;
}

Parsed<tool::EmbedOptions> embedding(const Cell& cell, const Settings& settings, const fs::path& folder) {
  Words needed = data_and_out(cell, folder);
  needed.insert(needed.end(), {"--model", (folder / model_files[unmarked]).string(), "--key", settings.key().string(),
                               "--decoder", tool::fitted_decoder_word});
  Parsed<tool::EmbedOptions> command =
      parse<tool::EmbedOptions>("embed", needed, divide(words_for(cell.codec, tool::renamed(settings.extra))).mark);
  if (!command) return command;
  tool::EmbedOptions& bound = (*command)->bound;
  set_common(bound, cell, settings);
  bound.settings.mark.bits = static_cast<std::size_t>(settings.bits);
  return command;
}

/// Runs the command by its function; `said` is the file of its figures.
template <class Bound, class Function>
Result<bool> run(Parsed<Bound> command, Function function, const fs::path& said) {
  if (!command) return command.error();
  const auto taken = tool::take_files((*command)->options.use());
  if (!taken) return taken.error();
  const auto close = [](std::FILE* file) { std::fclose(file); };
  const std::unique_ptr<std::FILE, decltype(close)> figures(std::fopen(said.c_str(), "w"), close);
  const auto unwritable = [&] {
    return Error{
        ErrorKind::unwritable, said.string(), {}, std::strerror(errno), "is there room, and may you write there?"};
  };
  if (!figures) return unwritable();
  const Bound& bound = (*command)->bound;
  compmark::ThreadExecutor executor(bound.run.threads);
  tool::tell_threads(executor, bound.run.threads);
  tool::RunTelling telling(bound.settings.out, bound.run.json_log, bound.settings.resume, figures.get(),
                           tool::PeakMemory::from_now());
  const Result<compmark::RunOutcome> outcome = function(bound.settings, executor, telling);
  if (!outcome && outcome.error().kind == ErrorKind::cancelled) {
    tool::print_note(outcome.error().problem);
    return false;
  }
  if (const std::optional<Error> failed = telling.failure(outcome)) return *failed;
  if (std::fflush(figures.get()) != 0) return unwritable();
  return !tool::interrupted();  // the signal may have come after the last iteration
}

}  // namespace

Result<Done> FunctionSteps::check(Step step, const Cell& cell, const Settings& settings) const {
  const auto outcome = [](const auto& command) -> Result<Done> {
    if (!command) return command.error();
    return Done{};
  };
  const fs::path folder = cell.folder(settings);
  if (step == Step::evaluate || step == Step::compress) return Done{};
  if (step == Step::embed) return outcome(embedding(cell, settings, folder));
  if (step == Step::fit_codec) return outcome(codec_fit(cell, settings, folder));
  return outcome(training(step, cell, settings, folder));
}

Result<Done> FunctionSteps::make_key(const Settings& settings) const {
  compmark::KeySettings key;
  key.out = settings.key();
  key.bits = static_cast<std::size_t>(settings.bits);
  const HoldStop hold;
  const Result<std::string> told = tool::make_dated_key(std::move(key));
  if (!told) return told.error();
  return compmark::write_file(settings.out / "keygen.txt", *told);
}

Result<bool> FunctionSteps::take(Step step, const Cell& cell, const Settings& settings, const fs::path& folder) const {
  const fs::path said = folder / (std::string(step_name(step)) + ".txt");
  try {
    if (step == Step::evaluate) {
      if (Result<Done> measured = measure_cell(cell, settings); !measured) return measured.error();
      return true;
    }
    if (step == Step::compress) {
      const fs::path trained = settings.out / curve_name(training_of(cell), settings);
      if (Result<Done> coded = code_trained(cell, settings, trained, folder); !coded) return coded.error();
      return true;
    }
    if (step == Step::embed) return run(embedding(cell, settings, folder), compmark::embed_message, said);
    if (step == Step::fit_codec) return run(codec_fit(cell, settings, folder), compmark::fit_codec, said);
    return run(training(step, cell, settings, folder), compmark::train_scene, said);
  } catch (...) {
    return tool::caught_error();
  }
}

}  // namespace fidelity
