// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is written of a comparison for programs: JSON and CSV (docs/results.md).
#include <algorithm>
#include <array>
#include <compmark/watermark/proof/report.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "comparison.hpp"
#include "comparison_measures.hpp"

namespace tool {
namespace {

using namespace compmark;

double share(std::size_t right, std::size_t bits) { return static_cast<double>(right) / static_cast<double>(bits); }

nlohmann::ordered_json figures(const Comparison& comparison, const ComparedModel& model) {
  nlohmann::ordered_json json;
  for (const Measure& measure : measures) {
    if (const std::optional<double> value = mean_of(measure, comparison, model)) json[measure.name] = *value;
  }
  json["bytes"] = model.bytes;
  json["anchors"] = model.anchors;
  if (!model.codec.empty()) {
    json["codec"] = model.codec;
    for (const auto& [name, bytes] : model.sections) json["sections"][name] = bytes;
  }
  const auto add_read = [](nlohmann::ordered_json& to, const Verification& verification) {
    const BitAccuracy accuracy = bit_accuracy(verification);
    to["bits"] = verification.bits;
    to["bit_accuracy"] = {{"mean", accuracy.mean}, {"min", accuracy.min}, {"views", accuracy.views}};
    to["bits_right"] = verification.evidence.matches;
    to["p_value"] = verification.evidence.p_value;
    to["largest_view_p_value"] = accuracy.largest_p;
  };
  if (model.verification) add_read(json, *model.verification);
  for (const ReadAfterAttack& after : model.attacked) {
    nlohmann::ordered_json entry{{"attack", after.attack}};
    add_read(entry, after.verification);
    if (after.psnr) entry["psnr_to_unattacked"] = *after.psnr;
    json["attacks"].push_back(std::move(entry));
  }
  if (model.unmarked) json["twin"] = *model.unmarked;
  return json;
}

nlohmann::ordered_json view_figures(const Comparison& comparison, const ComparedModel& model) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < model.evaluation.views.size(); ++i) {
    nlohmann::ordered_json entry{{"name", model.evaluation.views[i].name}};
    for (const Measure& measure : measures) {
      if (const std::optional<double> value = measure.of_view(comparison, model, i)) entry[measure.name] = *value;
    }
    entry["gaussians"] = model.evaluation.views[i].gaussians;
    if (model.verification) {
      const Evidence& evidence = model.verification->views[i];
      entry["bit_accuracy"] = share(evidence.matches, model.verification->bits);
      entry["bits_right"] = evidence.matches;
      entry["p_value"] = evidence.p_value;
    }
    json.push_back(std::move(entry));
  }
  return json;
}

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}
std::string number(std::optional<double> value) { return value ? format_text("%.9g", *value) : std::string(); }

/// The oldest columns in their order, then later ones: readers that go by position stay valid.
constexpr std::array csv_first = {"model",
                                  "codec",
                                  "bytes",
                                  "view",
                                  "psnr",
                                  "ssim",
                                  "lpips_alex",
                                  "lpips_squeeze",
                                  "psnr_vs_unmarked",
                                  "bits_right",
                                  "bits",
                                  "p_value",
                                  "milliseconds",
                                  "gaussians",
                                  "scope",
                                  "unmarked",
                                  "anchors",
                                  "bit_accuracy",
                                  "bit_accuracy_min",
                                  "largest_view_p_value",
                                  "attack"};

/// A line's cells by the name of their column; what is not there is empty.
using Cells = std::map<std::string, std::string>;

/// What all lines of a model say.
Cells cells_of(const Comparison& comparison, const ComparedModel& model) {
  Cells cells{{"model", csv_text(model.name)},
              {"codec", model.codec},
              {"bytes", std::to_string(model.bytes)},
              {"anchors", std::to_string(model.anchors)}};
  if (model.unmarked) cells["unmarked"] = csv_text(comparison.models[*model.unmarked].name);
  if (model.verification) cells["bits"] = std::to_string(model.verification->bits);
  return cells;
}
/// What all views of a model say together, and in the mean.
void add_read(Cells& cells, const Verification& verification) {
  const BitAccuracy accuracy = bit_accuracy(verification);
  cells["bits_right"] = std::to_string(verification.evidence.matches);
  cells["bit_accuracy"] = number(accuracy.mean);
  cells["bit_accuracy_min"] = number(accuracy.min);
  cells["p_value"] = number(verification.evidence.p_value);
  cells["largest_view_p_value"] = number(accuracy.largest_p);
}
Cells view_cells(const Comparison& comparison, const ComparedModel& model, std::size_t view) {
  Cells cells = cells_of(comparison, model);
  const ViewResult& result = model.evaluation.views[view];
  cells["scope"] = "view";
  cells["view"] = csv_text(result.name);
  cells["gaussians"] = std::to_string(result.gaussians);
  for (const Measure& measure : measures) cells[measure.name] = number(measure.of_view(comparison, model, view));
  if (model.verification) {
    const Evidence& evidence = model.verification->views[view];
    cells["bits_right"] = std::to_string(evidence.matches);
    cells["bit_accuracy"] = number(share(evidence.matches, model.verification->bits));
    cells["p_value"] = number(evidence.p_value);
  }
  return cells;
}
Cells model_cells(const Comparison& comparison, const ComparedModel& model) {
  Cells cells = cells_of(comparison, model);
  cells["scope"] = "model";
  cells["gaussians"] =
      number(model.evaluation.mean([](const ViewResult& v) { return static_cast<double>(v.gaussians); }));
  for (const Measure& measure : measures) cells[measure.name] = number(mean_of(measure, comparison, model));
  for (const auto& [name, bytes] : model.sections) cells["section: " + name] = std::to_string(bytes);
  if (model.verification) add_read(cells, *model.verification);
  return cells;
}
/// A line of all views after an attack.
Cells attack_cells(const Comparison& comparison, const ComparedModel& model, const ReadAfterAttack& after) {
  Cells cells = cells_of(comparison, model);
  cells["scope"] = "attack";
  cells["attack"] = csv_text(after.attack);
  add_read(cells, after.verification);
  if (after.psnr) cells["psnr"] = number(*after.psnr);
  return cells;
}

}  // namespace

nlohmann::ordered_json comparison_json(const Comparison& comparison) {
  nlohmann::ordered_json json{{"schema", "compmark.evaluation.1"}, {"split", split_name(comparison.split)}};
  json.update(figures(comparison, comparison.models.front()));
  for (const ComparedModel& model : comparison.models) {
    nlohmann::ordered_json entry{
        {"file", model.path.filename().string()}, {"name", model.name}, {"unmarked", model.is_unmarked}};
    entry.update(figures(comparison, model));
    entry["views"] = view_figures(comparison, model);
    json["models"].push_back(std::move(entry));
  }
  json["views"] = view_figures(comparison, comparison.models.front());
  return json;
}

std::string comparison_csv(const Comparison& comparison) {
  std::vector<std::string> columns(csv_first.begin(), csv_first.end());
  const auto add = [&](const std::string& name) {
    if (std::find(columns.begin(), columns.end(), name) == columns.end()) columns.push_back(name);
  };
  for (const Measure& measure : measures) add(measure.name);
  for (const ComparedModel& model : comparison.models) {
    for (const auto& [name, bytes] : model.sections) add("section: " + name);
  }
  std::string text;
  for (std::size_t c = 0; c < columns.size(); ++c) text += (c == 0 ? "" : ",") + csv_text(columns[c]);
  text += "\r\n";
  const auto line = [&](const Cells& cells) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const auto cell = cells.find(columns[c]);
      text += (c == 0 ? "" : ",") + (cell == cells.end() ? std::string() : cell->second);
    }
    text += "\r\n";
  };
  for (const ComparedModel& model : comparison.models) {
    for (std::size_t i = 0; i < model.evaluation.views.size(); ++i) line(view_cells(comparison, model, i));
    line(model_cells(comparison, model));
    for (const ReadAfterAttack& after : model.attacked) line(attack_cells(comparison, model, after));
  }
  return text;
}

}  // namespace tool
