// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "comparison.hpp"

#include <algorithm>
#include <compmark/mark/key.hpp>
#include <compmark/mark/message.hpp>
#include <compmark/mark/report.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <set>

#include "coded_run.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "mark_input.hpp"
#include "reading.hpp"
#include "svg_plot.hpp"

namespace tool {
namespace {

using namespace compmark;

/// A model with the photographs as its own lens, unit and background want them.
struct Opened {
  std::unique_ptr<AnyModel> model;
  Dataset dataset;
  std::unique_ptr<ImageStore> store;
  DatasetViews views;
};

Result<std::unique_ptr<Opened>> open_model(const std::filesystem::path& path, const ComparisonInput& input,
                                           std::set<std::string>& warned) {
  auto opened = std::make_unique<Opened>();
  Result<std::unique_ptr<AnyModel>> model = load_model(path, input.threads);
  if (!model) return model.error();
  opened->model = std::move(*model);
  DatasetSettings settings = settings_of(opened->model->info);
  settings.downscale = input.downscale;
  for (std::size_t c = 0; c < 3; ++c)
    settings.background[c] = static_cast<float>(opened->model->render_settings.background[c]);
  Result<Dataset> dataset = open_for(opened->model->info, input.data, settings);
  if (!dataset) return dataset.error();
  opened->dataset = std::move(*dataset);
  for (const std::string& warning : opened->dataset.warnings) {
    if (warned.insert(warning).second) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  }
  opened->store = std::make_unique<ImageStore>(opened->dataset, settings);
  opened->views = {&opened->dataset, opened->store.get(),
                   opened->dataset.indices(input.split == "test" ? Split::test : Split::train)};
  if (opened->views.size() == 0) {
    return Error{ErrorKind::invalid, input.data.string(), input.split + " split", "holds no view",
                 "choose the other split with --split"};
  }
  return opened;
}

/// Who reads the message, if anybody.
struct Reader {
  Decoder decoder;
  Message message;
  Decoder::Context context;
};
Result<std::unique_ptr<Reader>> open_reader(const ComparisonInput& input) {
  if (input.key.empty() && input.decoder.empty()) return std::unique_ptr<Reader>();
  if (input.key.empty() || input.decoder.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 input.key.empty() ? "--key" : "--decoder",
                 "is missing",
                 "a message is read with both, --key and --decoder"};
  }
  const Result<OwnerKey> key = load_key(input.key);
  if (!key) return key.error();
  Result<Decoder> decoder = load_decoder(input.decoder, &*key);
  if (!decoder) return decoder.error();
  auto reader = std::make_unique<Reader>();
  reader->decoder = std::move(*decoder);
  reader->message = message_of(*key);
  return reader;
}

Result<ComparedModel> measure(Opened& opened, const std::filesystem::path& path, Opened* twin, Reader* reader,
                              const ComparisonInput& input, ThreadExecutor& executor) {
  ComparedModel found;
  found.path = path;
  std::error_code ignored;
  found.bytes = std::filesystem::file_size(path, ignored);
  if (is_coded_file(path)) {
    Result<CodedFile> file = coded_file(path);
    if (!file) return file.error();
    found.codec = file->codec;
    found.sections = std::move(file->sections);
  }
  found.anchors = opened.model->anchor_count();
  const std::size_t count = opened.views.size(), shown = std::min(input.shown, count);
  std::vector<ViewLogits> read;
  std::optional<Error> failure;
  Result<Evaluation> evaluation = evaluate_views(
      *opened.model, opened.views, input.lpips, executor,
      [&](std::size_t i, const ViewResult& view, ImageView<const float> render, ImageView<const float> truth) {
        if (failure) return;
        for (std::size_t s = 0; s < shown; ++s) {
          if (i == s * count / shown)
            found.views.push_back({view.name + ", " + path.filename().string(), make_report_image(truth),
                                   make_report_image(render), view.psnr, view.ssim, view.lpips_alex});
        }
        if (reader != nullptr) {
          Result<ViewLogits> logits = read_logits(reader->decoder, render, view.name, reader->context, executor);
          if (!logits) {
            failure = logits.error();
            return;
          }
          read.push_back(std::move(*logits));
        }
        if (twin == nullptr) return;
        const Result<RenderedView> plain = twin->model->render(twin->views.camera(i), twin->views.lens(i), executor);
        if (!plain) {
          failure = plain.error();
          return;
        }
        round_to_8bit<float>(plain->image, plain->image);
        found.psnr_vs_unmarked.push_back(psnr(render, ImageView<const float>(plain->image)));
      });
  if (!evaluation) return evaluation.error();
  if (failure) return *failure;
  found.evaluation = std::move(*evaluation);
  if (reader != nullptr) {
    Result<Verification> verification = verify_message(reader->message, read, VerifySettings{});
    if (!verification) return verification.error();
    found.verification = std::move(*verification);
  }
  return found;
}

Error other_views(const std::filesystem::path& path, const std::filesystem::path& first) {
  return {ErrorKind::invalid, path.string(), "views",
          "are other ones, or of another size, than those of " + first.string(), "compare models of one capture"};
}
/// Whether two models are rendered at the same views, pixel by pixel.
Result<Done> check_views(const Opened& opened, const std::filesystem::path& path, const Opened& twin,
                         const std::filesystem::path& twin_path) {
  bool same = opened.views.size() == twin.views.size();
  for (std::size_t i = 0; same && i < opened.views.size(); ++i) {
    const Camera<double> a = opened.views.camera(i), b = twin.views.camera(i);
    same = a.width == b.width && a.height == b.height;
  }
  if (!same) return other_views(path, twin_path);
  return Done{};
}

double milliseconds(const ComparedModel& model) {
  return model.evaluation.mean([](const ViewResult& v) { return v.milliseconds; });
}

nlohmann::ordered_json figures(const Comparison& comparison, const ComparedModel& model) {
  const Evaluation& evaluation = model.evaluation;
  nlohmann::ordered_json json{{"psnr", model.psnr()},
                              {"ssim", evaluation.mean([](const ViewResult& v) { return v.ssim; })}};
  if (comparison.lpips_alex) json["lpips_alex"] = evaluation.mean([](const ViewResult& v) { return *v.lpips_alex; });
  if (comparison.lpips_squeeze)
    json["lpips_squeeze"] = evaluation.mean([](const ViewResult& v) { return *v.lpips_squeeze; });
  if (const std::optional<double> fitted = evaluation.colour_fitted()) json["psnr_colour_fitted"] = *fitted;
  json["milliseconds"] = milliseconds(model);
  json["bytes"] = model.bytes;
  json["anchors"] = model.anchors;
  if (!model.codec.empty()) {
    json["codec"] = model.codec;
    for (const auto& [name, bytes] : model.sections) json["sections"][name] = bytes;
  }
  if (model.verification) {
    const BitAccuracy accuracy = bit_accuracy(*model.verification);
    json["bit_accuracy"] = {{"mean", accuracy.mean}, {"min", accuracy.min}, {"views", accuracy.views}};
    json["bits_right"] = model.verification->evidence.matches;
    json["p_value"] = model.verification->evidence.p_value;
    json["largest_view_p_value"] = accuracy.largest_p;
  }
  if (const std::optional<double> cost = comparison.cost(model)) {
    json["psnr_cost_vs_unmarked"] = *cost;
    json["psnr_vs_unmarked"] = *model.mean_vs_unmarked();
  }
  return json;
}

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

double ComparedModel::psnr() const {
  return evaluation.mean([](const ViewResult& v) { return v.psnr; });
}

std::optional<double> ComparedModel::mean_vs_unmarked() const {
  if (psnr_vs_unmarked.empty()) return std::nullopt;
  double sum = 0;
  for (const double value : psnr_vs_unmarked) sum += value;
  return sum / static_cast<double>(psnr_vs_unmarked.size());
}

std::optional<double> Comparison::cost(const ComparedModel& model) const {
  if (model.is_unmarked || !models.back().is_unmarked) return std::nullopt;
  return models.back().psnr() - model.psnr();
}

Result<Comparison> compare_models(const ComparisonInput& input, ThreadExecutor& executor) {
  Comparison comparison;
  comparison.split = input.split;
  comparison.lpips_alex = !input.lpips.alex.empty();
  comparison.lpips_squeeze = !input.lpips.squeeze.empty();
  const Result<std::unique_ptr<Reader>> reader = open_reader(input);
  if (!reader) return reader.error();
  if (*reader) comparison.message = (*reader)->message;
  std::set<std::string> warned;
  std::unique_ptr<Opened> twin;
  if (!input.unmarked.empty()) {
    Result<std::unique_ptr<Opened>> opened = open_model(input.unmarked, input, warned);
    if (!opened) return opened.error();
    twin = std::move(*opened);
  }
  for (const std::filesystem::path& path : input.models) {
    const Result<std::unique_ptr<Opened>> opened = open_model(path, input, warned);
    if (!opened) return opened.error();
    if (Result<Done> same = check_views(**opened, path, twin ? *twin : **opened, input.unmarked); !same)
      return same.error();
    if (!comparison.models.empty() && comparison.models[0].evaluation.views.size() != (*opened)->views.size())
      return other_views(path, input.models[0]);
    Result<ComparedModel> found = measure(**opened, path, twin.get(), reader->get(), input, executor);
    if (!found) return found.error();
    comparison.models.push_back(std::move(*found));
  }
  if (twin) {
    Result<ComparedModel> found = measure(*twin, input.unmarked, nullptr, reader->get(), input, executor);
    if (!found) return found.error();
    found->is_unmarked = true;
    comparison.models.push_back(std::move(*found));
  }
  return comparison;
}

ReportGrid comparison_grid(const Comparison& comparison) {
  ReportGrid grid;
  grid.heading = "Models";
  const bool twin = comparison.models.back().is_unmarked, reads = comparison.models.front().verification.has_value();
  grid.columns = {"model", "codec", "bytes", "anchors", "PSNR, dB", "SSIM"};
  if (comparison.lpips_alex) grid.columns.emplace_back("LPIPS-alex");
  if (comparison.lpips_squeeze) grid.columns.emplace_back("LPIPS-squeeze");
  if (twin) grid.columns.insert(grid.columns.end(), {"dB lost", "against unmarked, dB"});
  if (reads) grid.columns.insert(grid.columns.end(), {"bits a view", "worst view", "all views", "p"});
  grid.columns.emplace_back("ms a view");
  for (const ComparedModel& model : comparison.models) {
    const Evaluation& evaluation = model.evaluation;
    std::vector<std::string> row{model.path.filename().string() + (model.is_unmarked ? " (unmarked)" : ""),
                                 model.codec.empty() ? "none" : model.codec,
                                 std::to_string(model.bytes),
                                 std::to_string(model.anchors),
                                 format_text("%.3f", model.psnr()),
                                 format_text("%.4f", evaluation.mean([](const ViewResult& v) { return v.ssim; }))};
    if (comparison.lpips_alex)
      row.push_back(format_text("%.4f", evaluation.mean([](const ViewResult& v) { return *v.lpips_alex; })));
    if (comparison.lpips_squeeze)
      row.push_back(format_text("%.4f", evaluation.mean([](const ViewResult& v) { return *v.lpips_squeeze; })));
    if (twin) {
      const std::optional<double> cost = comparison.cost(model);
      row.push_back(cost ? format_text("%.3f", *cost) : "");
      row.push_back(cost ? format_text("%.2f", *model.mean_vs_unmarked()) : "");
    }
    if (reads) {
      const Verification& verification = *model.verification;
      const BitAccuracy accuracy = bit_accuracy(verification);
      row.push_back(format_text("%.4f", accuracy.mean));
      row.push_back(format_text("%.4f", accuracy.min));
      row.push_back(format_text("%zu of %zu", verification.evidence.matches, verification.bits));
      row.push_back(format_text("%.1e", verification.evidence.p_value));
    }
    row.push_back(format_text("%.1f", milliseconds(model)));
    grid.rows.push_back(std::move(row));
  }
  return grid;
}

std::string grid_text(const ReportGrid& grid) {
  std::vector<std::size_t> width;
  for (std::size_t c = 0; c < grid.columns.size(); ++c) {
    width.push_back(grid.columns[c].size());
    for (const std::vector<std::string>& row : grid.rows) width[c] = std::max(width[c], row[c].size());
  }
  std::string text;
  const auto line = [&](const std::vector<std::string>& cells) {
    for (std::size_t c = 0; c < cells.size(); ++c) {
      const std::string space(width[c] - cells[c].size(), ' ');
      text += c == 0 ? cells[c] + space : "  " + space + cells[c];
    }
    text += "\n";
  };
  line(grid.columns);
  for (const std::vector<std::string>& row : grid.rows) line(row);
  return text;
}

nlohmann::ordered_json comparison_json(const Comparison& comparison) {
  nlohmann::ordered_json json{{"schema", "compmark.evaluation.1"}, {"split", comparison.split}};
  json.update(figures(comparison, comparison.models.front()));
  for (const ComparedModel& model : comparison.models) {
    nlohmann::ordered_json entry{{"file", model.path.filename().string()}, {"unmarked", model.is_unmarked}};
    entry.update(figures(comparison, model));
    json["models"].push_back(std::move(entry));
  }
  for (const ViewResult& view : comparison.models.front().evaluation.views) {
    nlohmann::ordered_json entry{
        {"name", view.name}, {"psnr", view.psnr}, {"ssim", view.ssim}, {"milliseconds", view.milliseconds}};
    if (view.psnr_colour_fitted) entry["psnr_colour_fitted"] = *view.psnr_colour_fitted;
    if (view.lpips_alex) entry["lpips_alex"] = *view.lpips_alex;
    if (view.lpips_squeeze) entry["lpips_squeeze"] = *view.lpips_squeeze;
    json["views"].push_back(std::move(entry));
  }
  return json;
}

std::string comparison_csv(const Comparison& comparison) {
  std::string text =
      "model,codec,bytes,view,psnr,ssim,lpips_alex,lpips_squeeze,psnr_vs_unmarked,bits_right,bits,p_value,milliseconds,"
      "gaussians\r\n";
  const auto number = [](std::optional<double> value) { return value ? format_text("%.9g", *value) : std::string(); };
  for (const ComparedModel& model : comparison.models) {
    for (std::size_t i = 0; i < model.evaluation.views.size(); ++i) {
      const ViewResult& view = model.evaluation.views[i];
      const Evidence* const evidence = model.verification ? &model.verification->views[i] : nullptr;
      std::optional<double> between;
      if (!model.psnr_vs_unmarked.empty()) between = model.psnr_vs_unmarked[i];
      const std::vector<std::string> cells{csv_text(model.path.filename().string()),
                                           model.codec,
                                           std::to_string(model.bytes),
                                           csv_text(view.name),
                                           number(view.psnr),
                                           number(view.ssim),
                                           number(view.lpips_alex),
                                           number(view.lpips_squeeze),
                                           number(between),
                                           evidence != nullptr ? std::to_string(evidence->matches) : "",
                                           evidence != nullptr ? std::to_string(model.verification->bits) : "",
                                           evidence != nullptr ? number(evidence->p_value) : "",
                                           number(view.milliseconds),
                                           std::to_string(view.gaussians)};
      for (std::size_t c = 0; c < cells.size(); ++c) text += (c == 0 ? "" : ",") + cells[c];
      text += "\r\n";
    }
  }
  return text;
}

ReportInput comparison_report(const Comparison& comparison, const std::string& title) {
  ReportInput report;
  const ComparedModel& first = comparison.models.front();
  report.title = title;
  report.subtitle = std::to_string(first.evaluation.views.size()) + " " + comparison.split + " views of " +
                    std::to_string(comparison.models.size()) + (comparison.models.size() == 1 ? " model" : " models");
  for (const ComparedModel& model : comparison.models) {
    if (model.is_unmarked) continue;
    const std::string name = model.path.filename().string();
    report.headline.emplace_back(format_text("%.2f dB", model.psnr()), "PSNR, " + name);
    report.headline.emplace_back(format_text("%.1f KiB", static_cast<double>(model.bytes) / 1024), "size, " + name);
    if (model.verification) {
      report.headline.emplace_back(
          format_text("%zu of %zu", model.verification->evidence.matches, model.verification->bits),
          "bits read from all views, " + name);
    }
  }
  report.grids.push_back(comparison_grid(comparison));
  for (const ComparedModel& model : comparison.models) {
    if (model.sections.empty()) continue;
    ReportTable table;
    table.heading = model.path.filename().string() + ", bytes by section";
    for (const auto& [name, bytes] : model.sections)
      table.rows.emplace_back(name, format_text("%.1f KiB", static_cast<double>(bytes) / 1024));
    report.tables.push_back(std::move(table));
  }
  for (std::size_t v = 0; v < first.views.size(); ++v) {
    for (const ComparedModel& model : comparison.models) report.views.push_back(model.views[v]);
  }
  for (const ComparedModel& model : comparison.models) {
    if (!model.verification) continue;
    report.plots.push_back(
        logit_plot(comparison.message, *model.verification, "Bits, " + model.path.filename().string()));
  }
  return report;
}

}  // namespace tool
