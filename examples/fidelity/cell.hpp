// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One cell of the fidelity table, a scene with a codec: its folder, and the figures of its files. One training makes all
// four models of a cell: the unmarked one, its compressed file, the marked one, and its compressed file (or three runs
// do: fitted.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "../compmark/new_names.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"
#include "words.hpp"

namespace fidelity {

namespace fs = std::filesystem;
using compmark::Done, compmark::Error, compmark::ErrorKind, compmark::Result;

struct Scene {
  fs::path folder;
  std::string name;
  double downscale = 1;
};

/// Settings that every cell has in common.
struct Settings {
  fs::path out;
  std::int64_t iterations = 10000;
  double rate_lambda = 0.004;
  std::int64_t fit_codec = 0;  ///< above 0: the codec is fitted to a finished model, in so many iterations (fitted.hpp)
  bool universal = false;  ///< read by the decoder that comes with the tool; else by one that is fitted to the scene
  std::vector<std::string> attacks;  ///< on pictures: what is read after each of them is measured too
  int bits = 48;
  std::size_t threads = 0;
  fs::path lpips;                  ///< LPIPS-Alex weights; may be empty
  std::string key_id;              ///< of the owner's key, once it was read (open_run)
  std::vector<std::string> extra;  ///< words for `compmark train`

  [[nodiscard]] fs::path key() const { return out / "owner.key"; }
};

/// A model of a cell, by the files of its folder. The order of `models`.
enum Model : std::size_t { unmarked, unmarked_coded, marked, marked_coded };
inline constexpr std::array<const char*, 4> model_files = {"unmarked/model.safetensors", "unmarked.cmk",
                                                           "model.safetensors", "model.cmk"};

struct Figures {
  double psnr = 0, ssim = 0, bytes = 0;
  std::optional<double> lpips;
  std::optional<double> psnr_vs_unmarked,
      ssim_vs_unmarked;                   ///< of a marked model, against its counterpart before or after compression
  double accuracy = 0, worst = 0;         ///< shares of the bits: mean over the views, and of the worst
  double p_value = 1, worst_p_value = 1;  ///< of all views together; of the worst by itself
  std::size_t views = 0;
  std::vector<std::pair<std::string, double>> attacked;  ///< mean share of the bits after each of Settings::attacks
};

struct Row {
  std::string scene, codec;
  std::array<Figures, 4> models;
  double train_seconds = 0, fit_seconds = 0, mark_seconds = 0;  ///< training with that of a codec fitted afterwards

  /// dB that the mark costs, before or after compression.
  [[nodiscard]] double lost(bool compressed) const {
    return compressed ? models[unmarked_coded].psnr - models[marked_coded].psnr
                      : models[unmarked].psnr - models[marked].psnr;
  }
  /// Share of the file that the mark adds.
  [[nodiscard]] double more_bytes() const { return models[marked_coded].bytes / models[unmarked_coded].bytes - 1; }
  /// Points of bit accuracy that compression costs.
  [[nodiscard]] double lost_points() const { return 100 * (models[marked].accuracy - models[marked_coded].accuracy); }
};

struct Cell {
  Scene scene;
  std::string codec;

  [[nodiscard]] fs::path folder(const Settings& settings) const { return settings.out / (scene.name + "_" + codec); }
};

[[nodiscard]] inline std::string number_text(double value) { return nlohmann::json(value).dump(); }

/// The settings of the folder: other settings make another table.
[[nodiscard]] inline nlohmann::ordered_json settings_json(const Cell& cell, const Settings& settings) {
  nlohmann::ordered_json json = {{"schema", "compmark.fidelity-cell.4"},
                                 {"scene", fs::weakly_canonical(cell.scene.folder).string()},
                                 {"downscale", cell.scene.downscale},
                                 {"codec", cell.codec},
                                 {"lambda", settings.rate_lambda},
                                 {"iterations", settings.iterations},
                                 {"bits", settings.bits},
                                 {"train", words_that_count(settings.extra)}};
  if (settings.fit_codec > 0) json["fit_codec"] = settings.fit_codec;
  if (!settings.key_id.empty()) json["key"] = settings.key_id;
  if (settings.universal) json["decoder"] = "universal";
  // Defaults that have changed: cells of earlier ones do not belong into one table with new ones.
  if (cell.codec == "context_gs") json["steps"] = "held";
  json["regions"] = "limited";
  return json;
}

/// Whether anything was trained there.
[[nodiscard]] inline bool is_begun(const fs::path& folder) {
  for (const char* file : {"log.jsonl", "checkpoint.safetensors", "results.json", "unmarked"}) {
    if (fs::exists(folder / file)) return true;
  }
  return false;
}
/// Whether a cell.json has the wanted settings. Cells from before it had the key's id may be of any key, and options may
/// have had other names.
[[nodiscard]] inline bool same_settings(nlohmann::ordered_json found, nlohmann::ordered_json wanted) {
  if (wanted.contains("key") && found.is_object() && !found.contains("key")) wanted.erase("key");
  const auto with_new_names = [](nlohmann::ordered_json& json) {
    if (!json.is_object() || !json.contains("train") || !json["train"].is_array()) return;
    std::vector<std::string> words;
    for (const nlohmann::ordered_json& word : json["train"]) {
      if (!word.is_string()) return;
      words.push_back(word.get<std::string>());
    }
    json["train"] = tool::renamed(std::move(words));
  };
  with_new_names(found);
  with_new_names(wanted);
  return found == wanted;
}
/// Whether a folder's cell.json is there and of these settings.
[[nodiscard]] inline bool is_of(const fs::path& folder, const nlohmann::ordered_json& wanted) {
  const Result<nlohmann::ordered_json> found = compmark::read_json<nlohmann::ordered_json>(folder / "cell.json");
  return found && same_settings(*found, wanted);
}
/// A cell.json that names another key than this one: its bits are none of this key's message.
[[nodiscard]] inline std::optional<Error> other_key(const fs::path& file, const nlohmann::ordered_json& found,
                                                    const std::string& key_id) {
  if (key_id.empty() || !found.is_object()) return std::nullopt;
  const auto key = found.find("key");
  if (key == found.end() || *key == key_id) return std::nullopt;
  return Error{ErrorKind::invalid, file.string(), "key",
               "is " + key->dump() + ", and owner.key beside the cells is \"" + key_id + "\"",
               "put that key back as owner.key, or choose another --out"};
}
/// A cell's folder, made or found again with the same settings. A folder in which nothing was trained, as after options
/// that the training refused, may be used again.
[[nodiscard]] inline Result<Done> open_folder(const fs::path& folder, const nlohmann::ordered_json& wanted) {
  const fs::path file = folder / "cell.json";
  if (fs::exists(file) && is_begun(folder)) {
    const Result<nlohmann::ordered_json> found = compmark::read_json<nlohmann::ordered_json>(file);
    if (!found) return found.error();
    if (same_settings(*found, wanted)) return Done{};
    if (wanted.contains("key")) {
      if (std::optional<Error> other = other_key(file, *found, wanted["key"].get<std::string>())) return *other;
    }
    return Error{ErrorKind::invalid,
                 file.string(),
                 {},
                 "is of other settings: " + found->dump(),
                 "give those, or choose another --out"};
  }
  std::error_code status;
  fs::create_directories(folder, status);
  if (status) {
    return Error{
        ErrorKind::unwritable, folder.string(), {}, "cannot be created: " + status.message(), "choose another --out"};
  }
  return compmark::write_json(file, wanted);
}
[[nodiscard]] inline Result<Done> open_cell(const Cell& cell, const Settings& settings) {
  return open_folder(cell.folder(settings), settings_json(cell, settings));
}

/// The unmarked counterpart of each model on its side of the codec; an unmarked model is its own, as every model is
/// given one.
[[nodiscard]] inline std::vector<fs::path> counterparts(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const Model model : {unmarked, unmarked_coded, unmarked, unmarked_coded})
    paths.push_back(folder / model_files[model]);
  return paths;
}
/// Whether the training is over: the last file that it writes is there, and no checkpoint waits.
[[nodiscard]] inline bool is_trained(const fs::path& folder) {
  return fs::exists(folder / "results.json") && !fs::exists(folder / "checkpoint.safetensors");
}
/// Whether the models were measured after they were trained, with the measures that are asked for.
[[nodiscard]] inline bool is_measured(const fs::path& folder, const Settings& settings) {
  const Result<nlohmann::json> found = compmark::read_json(folder / "evaluate.json");
  const auto has_attacks = [&](const nlohmann::json& measured) {
    const std::size_t count = measured.contains("attacks") ? measured["attacks"].size() : 0;
    bool same = count == settings.attacks.size();
    for (std::size_t a = 0; same && a < count; ++a)
      same = measured["attacks"][a].value("attack", std::string()) == settings.attacks[a];
    return same;
  };
  return found && found->is_object() && (settings.lpips.empty() || found->contains("lpips_alex")) &&
         has_attacks(*found) &&
         fs::last_write_time(folder / "evaluate.json") >= fs::last_write_time(folder / "results.json");
}

[[nodiscard]] inline bool is_of(const Cell& cell, const Settings& settings) {
  return is_of(cell.folder(settings), settings_json(cell, settings));
}
/// Whether there is nothing left to run of it.
[[nodiscard]] inline bool is_finished(const Cell& cell, const Settings& settings) {
  return is_of(cell, settings) && is_trained(cell.folder(settings)) && is_measured(cell.folder(settings), settings);
}

/// The row of a finished cell, from its files.
[[nodiscard]] inline Result<Row> read_row(const Cell& cell, const Settings& settings) {
  const fs::path folder = cell.folder(settings);
  Row row;
  row.scene = cell.scene.name;
  row.codec = cell.codec;
  fs::path file = folder / "evaluate.json";
  const auto malformed = [&](const std::string& problem) {
    return Error{ErrorKind::malformed,
                 file.string(),
                 {},
                 "does not say what it should: " + problem,
                 "remove it to measure again, or the folder to train again"};
  };
  try {
    const Result<nlohmann::json> measured = compmark::read_json(file);
    if (!measured) return measured.error();
    for (std::size_t m = 0; m < row.models.size(); ++m) {
      const nlohmann::json& model = measured->at("models").at(m);
      Figures& figures = row.models[m];
      figures.psnr = model.at("psnr").get<double>();
      figures.ssim = model.at("ssim").get<double>();
      figures.bytes = model.at("bytes").get<double>();
      const auto figure = [&](const char* name, std::optional<double>& value) {
        if (model.contains(name)) value = model.at(name).get<double>();
      };
      figure("lpips_alex", figures.lpips);
      if (m == marked || m == marked_coded) {
        figure("psnr_vs_unmarked", figures.psnr_vs_unmarked);
        figure("ssim_vs_unmarked", figures.ssim_vs_unmarked);
      }
      const nlohmann::json& accuracy = model.at("bit_accuracy");
      figures.accuracy = accuracy.at("mean").get<double>();
      figures.worst = accuracy.at("min").get<double>();
      figures.views = accuracy.at("views").get<std::size_t>();
      figures.p_value = model.at("p_value").get<double>();
      figures.worst_p_value = model.at("largest_view_p_value").get<double>();
      if (!model.contains("attacks")) continue;
      for (const nlohmann::json& attack : model.at("attacks")) {
        figures.attacked.emplace_back(attack.at("attack").get<std::string>(),
                                      attack.at("bit_accuracy").at("mean").get<double>());
      }
    }
    std::vector<std::tuple<std::string, const char*, double*>> timed = {
        {"results.json", "train_seconds", &row.mark_seconds},
        {"unmarked/results.json", "train_seconds", &row.train_seconds}};
    if (!settings.universal) timed.emplace_back("decoder.json", "seconds", &row.fit_seconds);
    if (settings.fit_codec > 0)
      timed.emplace_back("../" + row.scene + "_host/results.json", "train_seconds", &row.train_seconds);
    for (const auto& [name, field, seconds] : timed) {
      file = folder / name;
      const Result<nlohmann::json> json = compmark::read_json(file);
      if (!json) return json.error();
      *seconds += json->at(field).get<double>();
    }
  } catch (const nlohmann::json::exception& problem) {
    return malformed(problem.what());
  }
  return row;
}

/// The finished cells of an earlier command into the same folder, with the same settings but for scene and codec, in
/// the order of their names.
[[nodiscard]] inline std::vector<Row> finished_rows(const Settings& settings) {
  std::vector<fs::path> folders;
  std::error_code status;
  for (fs::directory_iterator entry(settings.out, status), end; !status && entry != end; entry.increment(status)) {
    if (fs::exists(entry->path() / "cell.json")) folders.push_back(entry->path());
  }
  std::sort(folders.begin(), folders.end());
  std::vector<Row> rows;
  for (const fs::path& folder : folders) {
    const Result<nlohmann::ordered_json> found = compmark::read_json<nlohmann::ordered_json>(folder / "cell.json");
    if (!found) continue;
    Cell cell;
    const std::string name = folder.filename().string();
    for (const char* codec : {"hac", "context_gs"}) {
      const std::string end = std::string("_") + codec;
      if (name.size() > end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0) {
        cell.codec = codec;
        cell.scene.name = name.substr(0, name.size() - end.size());
      }
    }
    nlohmann::ordered_json wanted = settings_json(cell, settings);
    for (const char* own : {"scene", "downscale"}) {
      if (found->is_object() && found->contains(own)) wanted[own] = (*found)[own];
    }
    if (!same_settings(*found, wanted) || !is_trained(folder) || !is_measured(folder, settings)) continue;
    if (Result<Row> row = read_row(cell, settings); row) rows.push_back(std::move(*row));
  }
  return rows;
}

}  // namespace fidelity
