// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The cells of the robustness tables: which attacks there are, with their curves of strength and the paper's figures,
// and what was measured of each, in a file of its own, so that a command that was stopped goes on.
#pragma once

#include <compmark/app/files.hpp>
#include <compmark/app/robustness.hpp>
#include <compmark/core/result.hpp>
#include <compmark/io/json_file.hpp>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace robustness {

namespace fs = std::filesystem;
using compmark::Done;
using compmark::Error;
using compmark::ErrorKind;
using compmark::Result;
using compmark::RobustnessAttack;
using compmark::RobustnessCell;
using compmark::RobustnessKind;
using Json = nlohmann::ordered_json;

/// A row of a table.
struct Row {
  std::string table;
  RobustnessAttack attack;
  std::string paper = {};  ///< its mean bits of CompMarkGS, HAC and ContextGS, after compression, %
};

/// Each of one attack's strengths.
inline void add(std::vector<Row>& rows, const char* table, RobustnessKind kind, const char* name,
                std::initializer_list<const char*> strengths, const std::map<std::string, std::string>& paper = {}) {
  for (const char* strength : strengths) {
    const auto told = paper.find(strength);
    rows.push_back(
        {table, {kind, std::string(name) + ":" + strength}, told == paper.end() ? std::string() : told->second});
  }
}

/// What is measured where the command names nothing.
[[nodiscard]] inline std::vector<Row> all_rows() {
  using enum RobustnessKind;
  std::vector<Row> rows{{"renders", {none, "none"}, "95.9 / 94.0"}};
  const char* words = "pictures, by the paper's words";
  add(rows, words, picture, "noise", {"0.01", "0.02", "0.05", "0.1"}, {{"0.1", "95.5 / 93.0"}});
  add(rows, words, picture, "rotation", {"5", "15", "30", "-30"}, {{"30", "92.1 / 90.3"}});
  add(rows, words, picture, "resize", {"0.25", "0.5", "0.75", "0.9"}, {{"0.75", "91.7 / 90.1"}});
  add(rows, words, picture, "blur", {"0.1", "0.5", "1", "2"}, {{"0.1", "95.6 / 92.8"}});
  add(rows, words, picture, "crop", {"0.2", "0.4", "0.6", "0.8"}, {{"0.4", "90.8 / 89.3"}});
  add(rows, words, picture, "jpeg", {"10", "30", "50", "70", "90"}, {{"50", "88.8 / 85.3"}});
  const char* code = "pictures, by the field's attack code";
  add(rows, code, picture, "field_noise", {"0.1"}, {{"0.1", "95.5 / 93.0"}});
  add(rows, code, picture, "field_rotation", {"30"}, {{"30", "92.1 / 90.3"}});
  add(rows, code, picture, "field_scale", {"0.75"}, {{"0.75", "91.7 / 90.1"}});
  add(rows, code, picture, "field_blur", {"0.1", "0.8"}, {{"0.1", "95.6 / 92.8"}});
  add(rows, code, picture, "field_crop", {"0.4"});
  add(rows, code, picture, "field_brightness", {"0.5"});
  const char* more = "pictures, others";
  add(rows, more, picture, "brightness", {"0.8", "0.9", "1.1", "1.2"});
  add(rows, more, picture, "gamma", {"0.8", "0.9", "1.1", "1.3"});
  add(rows, more, picture, "contrast", {"0.8", "1.2"});
  add(rows, more, picture, "saturation", {"0", "0.7", "1.3"});
  add(rows, more, picture, "hue", {"-5", "5", "20"});
  add(rows, more, picture, "median", {"3", "5"});
  add(rows, more, picture, "sharpen", {"1"});
  add(rows, more, picture, "levels", {"4", "5", "6"});
  add(rows, more, picture, "palette", {"256", "64"});
  add(rows, more, picture, "resample", {"0.5"});
  add(rows, more, picture, "paint", {"0.2"});
  add(rows, more, picture, "mirror", {"1"});
  add(rows, more, picture, "frame", {"20"});
  add(rows, more, picture, "page", {"0.4"});
  add(rows, more, picture, "chat", {"0.6"});
  add(rows, more, picture, "screenshot", {"0.8"});
  const char* models = "models";
  add(rows, models, model, "parameter_noise", {"0.001", "0.002", "0.005", "0.01", "0.02"}, {{"0.005", "77.1 / 83.1"}});
  add(rows, models, model, "clone", {"0.1", "0.3", "0.5", "0.9"}, {{"0.5", "95.1 / 93.2"}});
  add(rows, models, model, "prune", {"0.1", "0.2", "0.3", "0.5"}, {{"0.2", "94.3 / 92.6"}});
  add(rows, models, model, "lightgaussian", {"0.2", "0.4", "0.66", "0.8"}, {{"0.66", "83.5"}});
  add(rows, models, model, "int8", {"0", "1"}, {{"0", "90.1"}});
  add(rows, models, model, "int4", {"0", "1"});
  add(rows, models, model, "float16", {"1"});
  add(rows, models, model, "prune_opacity", {"0.1", "0.3", "0.5"});
  add(rows, models, model, "noise", {"0.01", "0.05", "0.1"});
  add(rows, models, model, "jitter", {"0.02", "0.05", "0.2"});
  add(rows, models, model, "bias", {"0.05", "0.1", "0.2"});
  add(rows, models, model, "merge", {"0.05", "0.1", "0.3"});
  add(rows, models, model, "cutout", {"0.1", "0.3", "0.5"});
  const char* removal = "removal";
  add(rows, removal, model, "feature_noise", {"0.05", "0.1", "0.2", "0.5"});
  add(rows, removal, model, "smooth_features", {"0.1", "0.25", "0.5", "1"});
  add(rows, removal, model, "smooth_neighbours", {"0.1", "0.25", "0.5", "1"});
  add(rows, removal, pgd, "pgd", {"0.00392", "0.00784", "0.0157", "0.0314", "0.1"}, {{"0.1", "84.3"}});
  add(rows, removal, pgd, "pgd_random", {"0.0314", "0.1"});
  add(rows, removal, pgd, "pgd_no_key", {"0.0314", "0.1"});
  return rows;
}

/// A marked model and what reads it.
struct Scene {
  std::string name;
  fs::path model, key, decoder, unmarked;
};

[[nodiscard]] inline fs::path cell_file(const fs::path& out, const Scene& scene, const RobustnessAttack& attack) {
  std::string name = attack.text;
  for (char& c : name) c = c == ':' || c == '/' ? '_' : c;
  const char* kind = attack.kind == RobustnessKind::picture ? "picture_"
                     : attack.kind == RobustnessKind::model ? "model_"
                                                            : "";
  return out / "cells" / scene.name / (kind + name + ".json");
}

[[nodiscard]] inline Json cell_json(const RobustnessCell& cell) {
  Json json{{"views", cell.views},
            {"bits", cell.bits},
            {"bit_accuracy", {{"mean", cell.mean}, {"min", cell.worst}}},
            {"bits_right", cell.matches},
            {"p_value", cell.p_value},
            {"worst_view_p_value", cell.worst_p_value}};
  if (cell.missing_share != 0) json["missing_share"] = cell.missing_share;
  if (cell.psnr) json["psnr_to_unattacked"] = *cell.psnr;
  if (cell.informed > 0)
    json["informed"] = {{"pictures", cell.informed},
                        {"found", cell.found},
                        {"bits_right", cell.informed_matches},
                        {"spread_deviations", cell.spread_deviations},
                        {"p_value", cell.informed_p_value}};
  if (cell.restored)
    json["restored"] = {{"bit_accuracy", {{"mean", cell.restored->mean}, {"min", cell.restored->worst}}},
                        {"bits_right", cell.restored->matches},
                        {"p_value", cell.restored->p_value},
                        {"anchors", cell.restored->features.anchors},
                        {"found", cell.restored->features.found},
                        {"raised", cell.restored->features.raised}};
  return json;
}
[[nodiscard]] inline RobustnessCell cell_of(const Json& json) {
  RobustnessCell cell;
  cell.views = json.at("views");
  cell.bits = json.at("bits");
  cell.mean = json.at("bit_accuracy").at("mean");
  cell.worst = json.at("bit_accuracy").at("min");
  cell.matches = json.at("bits_right");
  cell.p_value = json.at("p_value");
  cell.worst_p_value = json.at("worst_view_p_value");
  if (json.contains("missing_share")) cell.missing_share = json.at("missing_share");
  if (json.contains("psnr_to_unattacked")) cell.psnr = json.at("psnr_to_unattacked").get<double>();
  if (json.contains("informed")) {
    const Json& informed = json.at("informed");
    cell.informed = informed.at("pictures");
    cell.found = informed.at("found");
    cell.informed_matches = informed.at("bits_right");
    cell.spread_deviations = informed.at("spread_deviations");
    cell.informed_p_value = informed.at("p_value");
  }
  if (json.contains("restored")) {
    const Json& restored = json.at("restored");
    compmark::RestoredCell& into = cell.restored.emplace();
    into.mean = restored.at("bit_accuracy").at("mean");
    into.worst = restored.at("bit_accuracy").at("min");
    into.matches = restored.at("bits_right");
    into.p_value = restored.at("p_value");
    into.features.anchors = restored.at("anchors");
    into.features.found = restored.at("found");
    into.features.raised = restored.at("raised");
  }
  return cell;
}

/// The cell of an earlier command, if it was measured of the same files in the same way.
[[nodiscard]] inline std::optional<RobustnessCell> finished_cell(const fs::path& file, const Json& of) {
  if (!fs::exists(file)) return std::nullopt;
  const Result<Json> json = compmark::read_json<Json>(file);
  if (!json || !json->contains("of") || (*json)["of"] != of) return std::nullopt;
  try {
    return cell_of(json->at("cell"));
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}
[[nodiscard]] inline Result<Done> write_cell(const fs::path& file, const Json& of, const RobustnessCell& cell) {
  std::error_code status;
  fs::create_directories(file.parent_path(), status);
  if (status) {
    return Error{ErrorKind::unwritable, file.parent_path().string(), "--out", "cannot be created: " + status.message(),
                 "choose another"};
  }
  return compmark::write_json(file, Json{{"of", of}, {"cell", cell_json(cell)}});
}

/// What a cell depends on.
[[nodiscard]] inline Result<Json> identity_of(const Scene& scene, const compmark::RobustnessSettings& settings) {
  Json of{{"views", settings.views}, {"seed", settings.seed}};
  const auto add_digest = [&](const char* name, const fs::path& file) -> Result<Done> {
    const Result<std::string> digest = compmark::file_sha256(file);
    if (!digest) return digest.error();
    of[name] = *digest;
    return Done{};
  };
  for (const auto& [name, file] : {std::pair("model", scene.model), std::pair("decoder", scene.decoder),
                                   std::pair("key", scene.key), std::pair("unmarked", scene.unmarked)}) {
    if (file.empty()) continue;
    if (Result<Done> added = add_digest(name, file); !added) return added.error();
  }
  of.erase("key");  // a digest of a secret's file stays at home
  const Result<compmark::OwnerKey> key = compmark::open_key(scene.key);
  if (!key) return key.error();
  of["key_commitment"] = key->commitment();
  if (settings.recipient != 0) of["recipient"] = settings.recipient;
  if (settings.pruned) of["pruned"] = true;
  if (settings.restored) of["restored"] = true;
  if (!scene.unmarked.empty()) of["informed_views"] = settings.informed_views;
  return of;
}

}  // namespace robustness
