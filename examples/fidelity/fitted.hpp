// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The other way to make a cell: an unmarked model is trained without a codec, one for each scene; then the codec is
// fitted to it, and the mark is hidden in the model of the codec's file. The unmarked model stays the owner's, and both
// codecs share it. Its folder, SCENE_host, belongs to no cell: two commands with one --out at a time would both train
// it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "cell.hpp"

namespace fidelity {

/// Options for `compmark train`, by the command that takes them here; some belong to two.
struct DividedWords {
  std::vector<std::string> host;   ///< for compmark train
  std::vector<std::string> codec;  ///< for compmark fit-codec
  std::vector<std::string> mark;   ///< for compmark embed
};

/// Names of options that are the mark's alone; each takes a value.
inline constexpr std::array<std::string_view, 12> mark_option_names = {
    "--period",          "--tone",           "--fidelity",       "--fidelity-fall", "--sample-by-loss",
    "--calibrate-steps", "--message-weight", "--message-margin", "--message-power", "--message-rate",
    "--message-every",   "--mark-iterations"};

[[nodiscard]] inline DividedWords divide(const std::vector<std::string>& words) {
  DividedWords divided;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::size_t equals = words[i].find('=');
    const std::string name = words[i].substr(0, equals);
    const bool of_mark = std::find(mark_option_names.begin(), mark_option_names.end(), name) != mark_option_names.end();
    const bool of_all = name == "--seed" || name == "--checkpoint-every";
    std::vector<std::string> taken = {words[i]};
    if ((of_mark || of_all) && equals == std::string::npos && i + 1 < words.size()) taken.push_back(words[++i]);
    if (name == "--mark-iterations") taken[0].erase(2, std::string_view("mark-").size());  // as embed has it
    const auto give = [&](std::vector<std::string>& to) { to.insert(to.end(), taken.begin(), taken.end()); };
    if (of_mark || of_all) give(divided.mark);
    if (!of_mark) give(divided.host);
    if (of_all) give(divided.codec);
  }
  return divided;
}

[[nodiscard]] inline fs::path host_folder(const Cell& cell, const Settings& settings) {
  return settings.out / (cell.scene.name + "_host");
}
/// The settings of the unmarked model.
[[nodiscard]] inline nlohmann::ordered_json host_json(const Cell& cell, const Settings& settings) {
  return {{"schema", "compmark.fidelity-host.1"},
          {"scene", fs::weakly_canonical(cell.scene.folder).string()},
          {"downscale", cell.scene.downscale},
          {"iterations", settings.iterations},
          {"train", words_that_count(divide(settings.extra).host)}};
}

namespace detail {
/// Options that all three commands get.
[[nodiscard]] inline std::vector<std::string> common_words(const char* command, const Cell& cell,
                                                           const Settings& settings, const fs::path& out) {
  return {settings.tool.string(),
          command,
          "--data",
          cell.scene.folder.string(),
          "--downscale",
          number_text(cell.scene.downscale),
          "--threads",
          std::to_string(settings.threads),
          "--out",
          out.string(),
          "--resume"};
}
inline void add(std::vector<std::string>& words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
}
}  // namespace detail

[[nodiscard]] inline std::vector<std::string> plain_host_command(const Cell& cell, const Settings& settings) {
  std::vector<std::string> words = detail::common_words("train", cell, settings, host_folder(cell, settings));
  detail::add(words, {"--for-fit-codec", "--iterations", std::to_string(settings.iterations)});
  detail::add(words, divide(settings.extra).host);
  return words;
}
[[nodiscard]] inline std::vector<std::string> fit_codec_command(const Cell& cell, const Settings& settings) {
  std::vector<std::string> words =
      detail::common_words("fit-codec", cell, settings, cell.folder(settings) / "unmarked");
  detail::add(words,
              {"--model", (host_folder(cell, settings) / "model.safetensors").string(), "--codec", cell.codec,
               "--lambda", number_text(settings.rate_lambda), "--iterations", std::to_string(settings.fit_codec)});
  detail::add(words, divide(settings.extra).codec);
  return words;
}
[[nodiscard]] inline std::vector<std::string> embed_command(const Cell& cell, const Settings& settings) {
  const fs::path folder = cell.folder(settings);
  std::vector<std::string> words = detail::common_words("embed", cell, settings, folder);
  detail::add(words, {"--model", (folder / model_files[unmarked]).string(), "--bits", std::to_string(settings.bits),
                      "--key", settings.key().string()});
  detail::add(words, divide(words_for(cell.codec, settings.extra)).mark);
  return words;
}

}  // namespace fidelity
