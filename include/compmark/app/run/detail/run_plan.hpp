// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One run as the functions of app prepare it: whatever it trains, from data or from a finished model.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/capture.hpp"
#include "compmark/app/run/embed_method.hpp"
#include "compmark/app/run/run_folder.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/app/run/run_settings.hpp"
#include "compmark/scene/dataset.hpp"

namespace compmark::detail {

struct RunPlan : RunSettings {
  std::string recipe;
  std::string profile = "scaffold";
  std::int64_t iterations = 0;
  LensTreatment lens = LensTreatment::undistort;
  std::optional<double> voxel_size;    ///< as it was given, in units of the dataset
  std::vector<std::string> simulated;  ///< effects of the recipe
  std::vector<std::string> notes;      ///< why it was chosen, told when the run starts
  MarkSettings mark;
  std::optional<EmbedMethod> method;   ///< of a mark that is hidden in a finished model
  int harmonics = 3;                   ///< degree of the splat file that is marked
  std::filesystem::path model;         ///< the finished model that is marked, or that a codec is fitted to
  std::filesystem::path with_spread;   ///< the same with MarkSettings::spread, which is then what the mark begins with
  bool intra = false;                  ///< the files of a model for HAC are HAC-plus (CodedModelSettings::intra)
  std::shared_ptr<const void> folder;  ///< holds `out` against other runs (run_folder.hpp)
  ThreadExecutor* executor = nullptr;
  RunObserver* observer = nullptr;
};

/// The marked Gaussians of a splat file, in the folder of the run.
inline constexpr const char* splat_file_name = "marked.ply";

/// The error of a run without resume that would overwrite a checkpoint.
[[nodiscard]] inline Error unfinished_run(const std::filesystem::path& checkpoint) {
  return {ErrorKind::invalid,
          checkpoint.string(),
          {},
          "an unfinished run is in this folder",
          "continue it with --resume, or remove the file to start over"};
}

/// The error for a recipe that cannot carry a message.
[[nodiscard]] inline Error no_message_in(const std::string& recipe) {
  return {ErrorKind::unsupported,
          {},
          "--recipe",
          "\"" + recipe + "\" cannot carry a message in this tool",
          "this tool marks finished models of every recipe that is named scaffold, hac or context_gs, of fit-codec and "
          "of splat files; a message trains together with scaffold, hac and context_gs alone or with +mask or +alpha, "
          "and with compmark-host and compmark-paper-host (--decoder)"};
}

/// Holds the run's folder, as soon as something is written into it.
[[nodiscard]] inline Result<Done> hold_run(RunPlan& plan) {
  if (plan.folder) return Done{};
  Result<std::shared_ptr<const void>> held = hold_folder(plan.out);
  if (!held) return held.error();
  plan.folder = std::move(*held);
  return Done{};
}

}  // namespace compmark::detail
