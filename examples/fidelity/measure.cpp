// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "measure.hpp"

#include <compmark/app/compare.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <utility>

#include "../compmark/comparison.hpp"
#include "../compmark/decoder_choice.hpp"
#include "../compmark/evaluation.hpp"
#include "stopping.hpp"

namespace fidelity {
Result<Done> measure_cell(const Cell& cell, const Settings& settings) {
  const fs::path folder = cell.folder(settings);
  compmark::CompareSettings compared;
  for (const char* file : model_files) compared.models.push_back(folder / file);
  compared.unmarked = counterparts(folder);
  compared.key = settings.key();
  if (settings.universal) {
    Result<fs::path> shipped = tool::shipped_decoder();
    if (!shipped) return shipped.error();
    compared.decoder = std::move(*shipped);
  } else {
    compared.decoder = folder / "decoder.safetensors";
  }
  compared.attacks = settings.attacks;
  compared.data = cell.scene.folder;
  compared.downscale = cell.scene.downscale;
  compared.evaluate = tool::evaluation_settings({settings.lpips, {}, false});
  compmark::ThreadExecutor executor(settings.threads);
  tool::ShownModels shown(3);
  const Result<tool::Comparison> comparison = compmark::compare_models(compared, executor, shown);
  if (!comparison) return comparison.error();
  const HoldStop hold;  // all files of one measurement, or none
  if (Result<Done> told = compmark::write_file(folder / "evaluate.txt", tool::evaluation_text(*comparison)); !told)
    return told;
  const tool::EvaluationFiles files{folder / "evaluate.json", folder / "evaluate.csv", folder / "evaluate.html"};
  return tool::write_evaluation(*comparison, shown.pictures, compared.data, executor.concurrency(), files);
}

}  // namespace fidelity
