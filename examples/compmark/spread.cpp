// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark spread: hides a spread-spectrum mark of a key in a model, for readers who have the unmarked one.
#include <compmark/app/spread.hpp>
#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "commands.hpp"
#include "common.hpp"
#include "options.hpp"
#include "reading.hpp"
#include "shell_word.hpp"

namespace tool {
namespace {

using namespace compmark;

struct SpreadOptions : SpreadMarkSettings {
  std::filesystem::path key;
  std::size_t threads = 0;
};

int spread(const SpreadOptions& options) {
  const Result<OwnerKey> key = load_key(options.key);
  if (!key) return fail(key.error());
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  const Result<SpreadMarked> marked = mark_spread(*key, options, executor);
  if (!marked) return fail(marked.error());
  std::printf("%s: %.2f dB between renders of the two, %zu cells of %.3g units\n", options.out.string().c_str(),
              marked->psnr, marked->cells, marked->cell_side);
  const std::string model = shell_word(options.model), key_file = shell_word(options.key),
                    claim = shell_word(options.model.string() + ".claim");
  std::printf(
      "Keep %s secret and whole: the mark is read by it, and is a proof where a claim names it\n"
      "next: compmark claim --key %s --unmarked %s --out %s\n"
      "then: compmark verify --images PICTURES --key %s --unmarked %s --claim %s\n",
      options.model.c_str(), key_file.c_str(), model.c_str(), claim.c_str(), key_file.c_str(), model.c_str(),
      claim.c_str());
  return success;
}

}  // namespace

Command add_spread(Options& app) {
  auto options = std::make_shared<SpreadOptions>();
  app.reads("--model", options->model, InputKind::markable,
            "the model, or a splat file, which becomes the unmarked one")
      ->required();
  app.reads("--key", options->key, InputKind::key, "the owner's key file (compmark keygen)")->required();
  app.writes("--out", options->out, OutputKind::model,
             "the marked model to write, which ends in .safetensors; compmark export makes splats of it")
      ->required();
  app.number("--psnr", options->psnr, RealRange{30, 80},
             "decibels between renders of the marked and the unmarked model; one picture proves a mark of 50")
      ->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  return [options]() -> int { return spread(*options); };
}

}  // namespace tool
