// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What one training of the ablations leaves behind: a JSON file of its own, written whole or not at all as soon as it
// is finished, so that a run that was stopped goes on where it was. A file counts only for the settings that it names.
// Cost: one small file a training.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"

namespace ablation {

/// Means over the test views; the accuracy of the worst view beside the mean. Without a message the accuracies are 0.
struct Measured {
  double accuracy = 0, worst = 0;  ///< shares of the bits
  double psnr = 0, ssim = 0;
};

struct Record {
  std::string scene, row;
  std::uint64_t seed = 0;
  Measured before, after;  ///< compression
  std::uint64_t anchors = 0, file_bytes = 0;
  double seconds = 0;               ///< of training; for information
  nlohmann::ordered_json settings;  ///< what it was trained with: another is another run
};

inline constexpr std::string_view record_schema = "compmark.ablation.1";

[[nodiscard]] inline nlohmann::ordered_json record_json(const Record& record) {
  const auto measured = [](const Measured& m) {
    return nlohmann::ordered_json{
        {"bit_accuracy", {{"mean", m.accuracy}, {"min", m.worst}}}, {"psnr", m.psnr}, {"ssim", m.ssim}};
  };
  return {{"schema", record_schema},
          {"scene", record.scene},
          {"row", record.row},
          {"seed", record.seed},
          {"before_compression", measured(record.before)},
          {"after_compression", measured(record.after)},
          {"anchors", record.anchors},
          {"file_bytes", record.file_bytes},
          {"train_seconds", record.seconds},
          {"settings", record.settings}};
}

/// `path` is for messages.
[[nodiscard]] inline compmark::Result<Record> record_from(const nlohmann::ordered_json& json,
                                                          const std::filesystem::path& path) {
  using compmark::Error, compmark::ErrorKind;
  Record record;
  try {
    if (json.at("schema") != record_schema) {
      return Error{ErrorKind::unsupported, path.string(), "schema", "is not " + std::string(record_schema),
                   "remove the file, and the training is run again"};
    }
    const auto measured = [](const nlohmann::ordered_json& from) {
      const nlohmann::ordered_json& accuracy = from.at("bit_accuracy");
      return Measured{accuracy.at("mean").get<double>(), accuracy.at("min").get<double>(),
                      from.at("psnr").get<double>(), from.at("ssim").get<double>()};
    };
    record.scene = json.at("scene").get<std::string>();
    record.row = json.at("row").get<std::string>();
    record.seed = json.at("seed").get<std::uint64_t>();
    record.before = measured(json.at("before_compression"));
    record.after = measured(json.at("after_compression"));
    record.anchors = json.at("anchors").get<std::uint64_t>();
    record.file_bytes = json.at("file_bytes").get<std::uint64_t>();
    record.seconds = json.at("train_seconds").get<double>();
    record.settings = json.at("settings");
  } catch (const nlohmann::json::exception& problem) {
    return Error{ErrorKind::malformed, path.string(), "record",
                 std::string("is not one of a training: ") + problem.what(),
                 "remove the file, and the training is run again"};
  }
  return record;
}

[[nodiscard]] inline std::filesystem::path record_path(const std::filesystem::path& out, std::string_view scene,
                                                       std::string_view row, std::uint64_t seed) {
  return out / "runs" / (std::string(scene) + "." + std::string(row) + "." + std::to_string(seed) + ".json");
}

[[nodiscard]] inline compmark::Result<compmark::Done> write_record(const std::filesystem::path& out,
                                                                   const Record& record) {
  return compmark::write_json(record_path(out, record.scene, record.row, record.seed), record_json(record));
}

enum class Found { nothing, other_settings, unreadable, finished };

/// Whether this training is there already, with the same settings; then `record` is it.
[[nodiscard]] inline Found find_record(const std::filesystem::path& out, std::string_view scene, std::string_view row,
                                       std::uint64_t seed, const nlohmann::ordered_json& settings, Record& record) {
  const std::filesystem::path path = record_path(out, scene, row, seed);
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return Found::nothing;
  const compmark::Result<nlohmann::ordered_json> json = compmark::read_json<nlohmann::ordered_json>(path);
  if (!json) return Found::unreadable;
  compmark::Result<Record> read = record_from(*json, path);
  if (!read || read->scene != scene || read->row != row || read->seed != seed) return Found::unreadable;
  // As text: what a file says of 1e-3 and what a program means by it are the same number, whatever its kind.
  if (read->settings.dump() != settings.dump()) return Found::other_settings;
  record = std::move(*read);
  return Found::finished;
}

}  // namespace ablation
