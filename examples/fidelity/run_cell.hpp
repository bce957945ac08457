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
#include <utility>
#include <vector>

#include "cell.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/owner_key.hpp"
#include "fitted.hpp"
#include "steps.hpp"

namespace fidelity {

/// What a program of many cells ends with.
struct RunEnd {
  int code = 0;       ///< of the process
  std::string table;  ///< in Markdown, for the terminal; may be empty
};

/// Takes a step of what is called so on stderr. False: it was stopped.
[[nodiscard]] inline Result<bool> take_step(const char* program, const std::string& name, const Steps& steps, Step step,
                                            const Cell& cell, const Settings& settings, const fs::path& folder) {
  std::fprintf(stderr, "%s: %s: %s\n", program, name.c_str(), step_name(step));
  return steps.take(step, cell, settings, folder);
}

/// Runs what of a cell is missing. Empty: the run was stopped.
[[nodiscard]] inline Result<std::optional<Row>> finish_cell(const char* program, const Cell& cell,
                                                            const Settings& settings, const Steps& steps) {
  const fs::path folder = cell.folder(settings);
  if (Result<Done> opened = open_cell(cell, settings); !opened) return opened.error();
  std::vector<std::pair<Step, fs::path>> needed;  // with the folder that the step finishes
  if (settings.fit_codec == 0) {
    needed = {{Step::train_marked, folder}};
  } else if (!is_trained(folder)) {
    const fs::path source = unmarked_folder(cell, settings);
    if (Result<Done> opened = open_folder(source, unmarked_json(cell, settings)); !opened) return opened.error();
    needed = {{Step::train_unmarked, source}, {Step::fit_codec, folder / "unmarked"}, {Step::embed, folder}};
  }
  const auto take = [&](Step step) {
    return take_step(program, cell.scene.name + ", " + cell.codec, steps, step, cell, settings, folder);
  };
  for (const auto& [step, finished] : needed) {
    if (is_trained(finished)) continue;
    const Result<bool> ended = take(step);
    if (!ended) return ended.error();
    if (!*ended) return std::optional<Row>();
  }
  if (!is_measured(folder, settings)) {
    const Result<bool> measured = take(Step::evaluate);
    if (!measured) return measured.error();
    if (!*measured) return std::optional<Row>();
  }
  Result<Row> row = read_row(cell, settings);
  if (!row) return row.error();
  return std::optional<Row>(std::move(*row));
}

/// Whether the words are right for every step of a cell.
[[nodiscard]] inline Result<Done> check_words(const Cell& cell, const Settings& settings, const Steps& steps) {
  if (settings.fit_codec == 0) return steps.check(Step::train_marked, cell, settings);
  for (const Step step : {Step::train_unmarked, Step::fit_codec, Step::embed}) {
    if (Result<Done> right = steps.check(step, cell, settings); !right) return right;
  }
  return Done{};
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
/// … with the owner's key of all cells, made once, whose id is noted in the settings.
[[nodiscard]] inline Result<Done> open_run(Settings& settings, const Steps& steps) {
  if (Result<Done> made = make_run_folder(settings); !made) return made;
  if (!fs::exists(settings.key())) {
    if (Result<Done> made = steps.make_key(settings); !made) return made;
  }
  const Result<compmark::OwnerKey> key = compmark::read_key(settings.key());
  if (!key) return key.error();
  settings.key_id = key->id();
  return Done{};
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
