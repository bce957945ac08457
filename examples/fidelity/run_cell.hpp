// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The folder of a run of cells, with the owner's key of all of them, and the unfinished part of a cell.
#pragma once

#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "cell.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/owner_key.hpp"
#include "fitted.hpp"
#include "measure.hpp"
#include "process.hpp"

namespace fidelity {

inline constexpr int stopped_exit = 130;  ///< the tool's, after Ctrl-C

/// Runs one command of a cell: prints it on stderr, and keeps its output in the folder. False: it was stopped.
[[nodiscard]] inline Result<bool> run_step(const char* program, const std::string& cell, const char* what,
                                           const std::vector<std::string>& command, const fs::path& folder) {
  std::fprintf(stderr, "%s: %s: %s\n", program, cell.c_str(), what);
  const Result<int> code = run_program(command, folder / (std::string(what) + ".txt"));
  if (!code) return code.error();
  if (*code == 0) return true;
  if (stopped() || *code == stopped_exit) return false;
  return Error{ErrorKind::invalid, folder.string(), what, "ended with exit code " + std::to_string(*code),
               "see what it printed; the same command goes on from there"};
}

/// The figures of a cell by this program itself.
[[nodiscard]] inline Result<bool> measured_here(const char* program, const Cell& cell, const Settings& settings) {
  std::fprintf(stderr, "%s: %s, %s: evaluate\n", program, cell.scene.name.c_str(), cell.codec.c_str());
  return measure_cell(cell, settings);
}

/// Runs what of a cell is missing. Empty: the run was stopped.
[[nodiscard]] inline Result<std::optional<Row>> finish_cell(const char* program, const Cell& cell,
                                                            const Settings& settings) {
  const fs::path folder = cell.folder(settings);
  if (Result<Done> opened = open_cell(cell, settings); !opened) return opened.error();
  const auto step = [&](const char* what, const std::vector<std::string>& command) {
    return run_step(program, cell.scene.name + ", " + cell.codec, what, command, folder);
  };
  const auto step_unless = [&](bool done, const char* what, const auto& command) -> Result<bool> {
    if (done) return true;
    const Result<bool> ended = step(what, command(cell, settings));
    return ended && stopped() ? false : ended;
  };
  if (settings.fit_codec > 0 && !is_trained(folder)) {
    const fs::path host = host_folder(cell, settings);
    if (Result<Done> opened = open_folder(host, host_json(cell, settings)); !opened) return opened.error();
    for (const auto& [done, what, command] :
         {std::tuple(is_trained(host), "host", &plain_host_command),
          std::tuple(is_trained(folder / "unmarked"), "fit-codec", &fit_codec_command)}) {
      const Result<bool> ended = step_unless(done, what, command);
      if (!ended) return ended.error();
      if (!*ended) return std::optional<Row>();
    }
  }
  const Result<bool> marked = step_unless(is_trained(folder), settings.fit_codec > 0 ? "embed" : "train",
                                          settings.fit_codec > 0 ? &embed_command : &train_command);
  if (!marked) return marked.error();
  if (!*marked) return std::optional<Row>();
  if (!is_measured(folder, settings)) {
    const Result<bool> measured =
        settings.own_tool ? measured_here(program, cell, settings) : step("evaluate", evaluate_command(cell, settings));
    if (!measured) return measured.error();
    if (!*measured) return std::optional<Row>();
  }
  Result<Row> row = read_row(cell, settings);
  if (!row) return row.error();
  return std::optional<Row>(std::move(*row));
}

/// The folder of the run.
[[nodiscard]] inline Result<Done> make_run_folder(const Settings& settings) {
  std::error_code status;
  fs::create_directories(settings.out, status);
  if (status) {
    return Error{ErrorKind::unwritable, settings.out.string(), "--out", "cannot be created: " + status.message(),
                 "choose another"};
  }
  return Done{};
}
/// … with the owner's key of all cells, made once, whose id is noted in the settings. False: the tool said why there is
/// none.
[[nodiscard]] inline Result<bool> open_run(Settings& settings) {
  if (Result<Done> made = make_run_folder(settings); !made) return made.error();
  if (!fs::exists(settings.key())) {
    const Result<int> code = run_program(
        {settings.tool.string(), "keygen", "--bits", std::to_string(settings.bits), "--out", settings.key().string()},
        settings.out / "keygen.txt");
    if (!code) return code.error();
    if (*code != 0) return false;
  }
  const Result<compmark::OwnerKey> key = compmark::read_key(settings.key());
  if (!key) return key.error();
  settings.key_id = key->id();
  return true;
}
/// Whether all cells of the folder that say so are of its key. One of another is neither left out of the table unsaid
/// nor in it.
[[nodiscard]] inline Result<Done> check_keys(const Settings& settings) {
  std::error_code status;
  for (fs::directory_iterator entry(settings.out, status), end; !status && entry != end; entry.increment(status)) {
    const fs::path file = entry->path() / "cell.json";
    if (!fs::exists(file) || !is_begun(entry->path())) continue;
    const Result<nlohmann::ordered_json> found = compmark::read_json<nlohmann::ordered_json>(file);
    if (!found) continue;  // what it is of is asked where it is needed
    if (std::optional<Error> other = other_key(file, *found, settings.key_id)) return *other;
  }
  return Done{};
}

}  // namespace fidelity
