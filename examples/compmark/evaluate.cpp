// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark evaluate: PSNR, SSIM and, given weights, LPIPS of a model against a dataset.
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include <compmark/io/json_file.hpp>

#include "commands.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "evaluation.hpp"

namespace tool {
namespace {

using namespace compmark;

struct EvaluateOptions {
  std::filesystem::path model;
  std::filesystem::path data;
  std::filesystem::path json;
  std::string split = "test";
  double downscale = 1;
  std::size_t threads = 0;
  LpipsFiles lpips;
};

int run(const EvaluateOptions& options) {
  Result<std::unique_ptr<AnyModel>> model = load_model(options.model, options.threads);
  if (!model) return fail(model.error());
  DatasetSettings settings = settings_of((*model)->info);
  settings.downscale = options.downscale;
  for (std::size_t c = 0; c < 3; ++c)
    settings.background[c] = static_cast<float>((*model)->render_settings.background[c]);
  Result<Dataset> dataset = open_for((*model)->info, options.data, settings);
  if (!dataset) return fail(dataset.error());
  for (const std::string& warning : dataset->warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  ImageStore store(*dataset, settings, {});
  const DatasetViews views{&*dataset, &store, dataset->indices(options.split == "test" ? Split::test : Split::train)};
  if (views.size() == 0) {
    return fail({ErrorKind::invalid, options.data.string(), options.split + " split", "holds no view",
                 "choose the other split with --split"});
  }
  ThreadExecutor executor(options.threads);
  Result<Evaluation> evaluation =
      evaluate_views(**model, views, options.lpips, executor,
                     [](std::size_t, const ViewResult& view, ImageView<const float>, ImageView<const float>) {
                       std::printf("%-24s PSNR %6.2f dB  SSIM %.4f", view.name.c_str(), view.psnr, view.ssim);
                       if (view.lpips_alex) std::printf("  LPIPS-alex %.4f", *view.lpips_alex);
                       if (view.lpips_squeeze) std::printf("  LPIPS-squeeze %.4f", *view.lpips_squeeze);
                       std::printf("  %.1f ms\n", view.milliseconds);
                     });
  if (!evaluation) return fail(evaluation.error());
  const double mean_psnr = evaluation->mean([](const ViewResult& v) { return v.psnr; });
  const double mean_ssim = evaluation->mean([](const ViewResult& v) { return v.ssim; });
  std::printf("mean over %zu views: PSNR %.3f dB  SSIM %.4f", views.size(), mean_psnr, mean_ssim);
  nlohmann::ordered_json json{
      {"schema", "compmark.evaluation.1"}, {"split", options.split}, {"psnr", mean_psnr}, {"ssim", mean_ssim}};
  if (!options.lpips.alex.empty()) {
    json["lpips_alex"] = evaluation->mean([](const ViewResult& v) { return *v.lpips_alex; });
    std::printf("  LPIPS-alex %.4f", json["lpips_alex"].get<double>());
  }
  if (!options.lpips.squeeze.empty()) {
    json["lpips_squeeze"] = evaluation->mean([](const ViewResult& v) { return *v.lpips_squeeze; });
    std::printf("  LPIPS-squeeze %.4f", json["lpips_squeeze"].get<double>());
  }
  const std::optional<double> fitted = evaluation->colour_fitted();
  if (fitted) {
    json["psnr_colour_fitted"] = *fitted;
    std::printf("  (PSNR %.3f dB with colours fitted)", *fitted);
  }
  std::printf("\n");
  if (options.json.empty()) return success;
  json["views"] = nlohmann::ordered_json::array();
  for (const ViewResult& view : evaluation->views) {
    nlohmann::ordered_json entry{
        {"name", view.name}, {"psnr", view.psnr}, {"ssim", view.ssim}, {"milliseconds", view.milliseconds}};
    if (view.psnr_colour_fitted) entry["psnr_colour_fitted"] = *view.psnr_colour_fitted;
    if (view.lpips_alex) entry["lpips_alex"] = *view.lpips_alex;
    if (view.lpips_squeeze) entry["lpips_squeeze"] = *view.lpips_squeeze;
    json["views"].push_back(std::move(entry));
  }
  if (Result<Done> written = write_file(options.json, json.dump(2) + "\n"); !written) return fail(written.error());
  return success;
}

}  // namespace

Command add_evaluate(CLI::App& app) {
  auto options = std::make_shared<EvaluateOptions>();
  app.add_option("--model", options->model, "model.safetensors of a run, or a compressed .cmk")->required();
  app.add_option("--data", options->data, "dataset folder (Blender, instant-ngp, nerfstudio, COLMAP or LLFF)")
      ->required();
  app.add_option("--split", options->split, "test or train")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "train"}));
  app.add_option("--json", options->json, "write the figures to this file");
  app.add_option("--downscale", options->downscale, "divide the images' size by this")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 64.0));
  app.add_option("--threads", options->threads, "0: all")->capture_default_str();
  app.add_option("--lpips-alex", options->lpips.alex, "LPIPS AlexNet weights (safetensors)");
  app.add_option("--lpips-squeeze", options->lpips.squeeze, "LPIPS SqueezeNet weights (safetensors)");
  app.add_flag("--lpips-family-range", options->lpips.family_range, "feed LPIPS [0,1] as the 3DGS family does");
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
