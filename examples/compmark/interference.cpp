// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark interference: measures what an unmarked model says to a message decoder by itself, and writes it to a small
// file for --interference of the commands that read.
#include <algorithm>
#include <compmark/app/interference.hpp>
#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "common.hpp"
#include "decoder_choice.hpp"
#include "options.hpp"

namespace tool {
namespace {

struct InterferenceOptions {
  compmark::InterferenceSettings settings;
  std::size_t threads = 0;
};

int interference(InterferenceOptions& options) {
  if (const auto chosen = choose_decoder(options.settings.decoder, options.settings.model); !chosen)
    return fail(chosen.error());
  compmark::ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  const auto measured = compmark::measure_interference(options.settings, executor);
  if (!measured) return fail(measured.error());
  std::printf("%s: %zu views, deviation of the outputs %.2f, of which other views tell %.0f %%\n",
              options.settings.out.string().c_str(), options.settings.views, measured->deviation,
              100 * std::max(0.0, measured->told));
  return success;
}

}  // namespace

Command add_interference(Options& app) {
  auto options = std::make_shared<InterferenceOptions>();
  app.reads("--model", options->settings.model, InputKind::model, "the unmarked model")->required();
  app.writes("--out", options->settings.out, OutputKind::interference,
             "file to write (safetensors); keep it with the key, and give it to verify --interference")
      ->required();
  app.reads("--decoder", options->settings.decoder, InputKind::decoder, reading_decoder_text);
  app.number("--views", options->settings.views, WholeRange{2, 5000},
             "sampled novel views, between the cameras of the training; memory is 16 bytes times their square")
      ->capture_default_str();
  app.number("--seed", options->settings.seed, any_seed, "seed of the views")->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  return [options]() -> int { return interference(*options); };
}

}  // namespace tool
