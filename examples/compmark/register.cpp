// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark register: the cameras from which pictures show the scene of a model, or that they show something else.
#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/app/files.hpp>
#include <compmark/app/picture.hpp>
#include <compmark/app/register.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/math/mirror.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/ssim.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "color_option.hpp"
#include "commands.hpp"
#include "common.hpp"
#include "model_files.hpp"
#include "report.hpp"
#include "run_options.hpp"

namespace tool {
namespace {

using namespace compmark;

struct RegisterOptions {
  std::filesystem::path model;
  std::vector<std::filesystem::path> images;
  std::filesystem::path json;
  std::filesystem::path html;
  std::string behind = "black";
  bool whole_images = false;
  std::size_t memory_budget_mb = PictureSettings{}.memory_budget_mb;
  RegisterSettings settings;
  std::size_t threads = 0;
};

nlohmann::ordered_json camera_json(const Camera<double>& camera, const ModelInfo& info) {
  std::array<double, 3> center{};
  for (std::size_t c = 0; c < 3; ++c) center[c] = info.origin[c] + info.unit * camera.center_world[c];
  return {{"width", camera.width},
          {"height", camera.height},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"rotation_camera_world", camera.rotation_camera_world},
          {"center_model", camera.center_world},
          {"center_dataset", center}};
}

/// The render at the camera that was found, with the tone of the picture, and mirrored where the picture is.
Result<std::vector<float>> aligned_render(AnyModel& model, const Registration& found, ThreadExecutor& executor) {
  const Result<RenderedView> render = model.render(found.camera, executor);
  if (!render) return render.error();
  const ImageView<const float> image = render->image;
  std::vector<float> values(image.data, image.data + image.size());
  const ImageView<float> to{values.data(), 3, image.height, image.width};
  apply_tone(found.tone, to);
  if (found.mirrored) mirror_rows(to);
  return values;
}

std::string shown(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

int run(const RegisterOptions& options) {
  const Result<std::vector<std::filesystem::path>> files = image_files(options.images);
  if (!files) return fail(files.error());
  Result<AnyModel> model = load_model(options.model, options.threads);
  if (!model) return fail(model.error());
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  const Result<std::vector<SearchPlace>> places = register_places(*model, options.settings, executor);
  if (!places) return fail(places.error());

  nlohmann::ordered_json json{{"schema", "compmark.registration.1"},
                              {"model", options.model.string()},
                              {"enough", options.settings.enough},
                              {"pictures", nlohmann::ordered_json::array()}};
  ReportInput page;
  page.title = "Where pictures were taken";
  page.subtitle = "in " + options.model.string();
  page.renders = "render at the camera that was found, in the tone of the picture";
  ReportGrid grid{"Pictures", {"picture", "verdict", "likeness", "uncertainty, pixels", "focal length, pixels"}, {}};
  std::size_t found_count = 0;
  bool left_out = false;
  // A picture that cannot be read, or is too small. The others are looked at all the same.
  const auto leave_out = [&](const std::filesystem::path& file, Error error) {
    if (error.file.empty()) error.file = file.string();
    const std::string name = file.filename().string();
    std::printf("%-32s left out\n", name.c_str());
    json["pictures"].push_back({{"name", name}, {"found", false}, {"error", error.line()}});
    if (!options.html.empty()) grid.rows.push_back({name, error.line(), "", "", ""});
    print_warning(error.line());
    left_out = true;
  };
  PictureSettings reading;
  reading.background = color_of(options.behind).value_or(reading.background);
  reading.pages = !options.whole_images;
  reading.memory_budget_mb = options.memory_budget_mb;
  for (const std::filesystem::path& file : *files) {
    const Result<OpenPicture> picture = open_picture(file, reading);
    if (!picture) {
      leave_out(file, picture.error());
      continue;
    }
    const ImageView<const float> image = picture->image();
    const Result<Registration> found = register_picture(*model, *places, image, options.settings, executor);
    if (!found) {
      leave_out(file, found.error());
      continue;
    }
    const std::string name = file.filename().string();
    nlohmann::ordered_json entry{
        {"name", name}, {"sha256", picture->sha256}, {"found", found->found}, {"likeness", found->likeness}};
    if (const std::optional<PictureBox>& part = picture->part)  // the camera is that of this part of the file
      entry["part"] = {{"left", part->left}, {"top", part->top}, {"width", part->width}, {"height", part->height}};
    if (found->found) {
      ++found_count;
      entry["mirrored"] = found->mirrored;
      entry["uncertainty_pixels"] = found->uncertainty_pixels;
      entry["camera"] = camera_json(found->camera, model->info());
      entry["tone"] = found->tone.term;
    }
    json["pictures"].push_back(std::move(entry));
    const std::string verdict = !found->found ? "not of this scene" : found->mirrored ? "found, mirrored" : "found";
    std::printf("%-32s %s, likeness %.3f", name.c_str(), verdict.c_str(), found->likeness);
    if (found->found && found->likeness < sure_likeness) {
      std::printf(", so the camera may be wrong: compare the picture with its render (--html)");
    } else if (found->found) {
      std::printf(", within %.2g pixels if differences are noise", found->uncertainty_pixels);
    }
    std::printf("\n");
    if (options.html.empty()) continue;
    grid.rows.push_back({name, verdict, shown("%.3f", found->likeness),
                         found->found ? shown("%.2g", found->uncertainty_pixels) : "",
                         found->found ? shown("%.1f", found->camera.fx) : ""});
    if (!found->found) continue;
    const Result<std::vector<float>> render = aligned_render(*model, *found, executor);
    if (!render) return fail(render.error());
    const ImageView<const float> aligned{render->data(), 3, image.height, image.width};
    page.views.push_back({name,
                          make_report_image(image),
                          make_report_image(aligned),
                          psnr(aligned, image),
                          ssim(aligned, image),
                          {},
                          {}});
  }
  if (!options.json.empty()) {
    if (Result<Done> written = write_json(options.json, json); !written) return fail(written.error());
  }
  if (!options.html.empty()) {
    page.headline.emplace_back(std::to_string(found_count) + " of " + std::to_string(files->size()),
                               "pictures found in the scene");
    page.grids.push_back(std::move(grid));
    if (Result<Done> written = write_report(options.html, page); !written) return fail(written.error());
  }
  std::printf("%zu of %zu found\n", found_count, files->size());
  if (left_out) return failure;
  return found_count == files->size() ? success : not_detected;
}

}  // namespace

Command add_register(Options& app) {
  auto options = std::make_shared<RegisterOptions>();
  app.reads("--model", options->model, InputKind::model, "model.safetensors of a run, or a compressed .cmk")
      ->required();
  app.reads("--images", options->images, InputKind::images, "image files, or folders of them (PNG, JPEG)")->required();
  app.writes("--json", options->json, OutputKind::words, "write the cameras to this file");
  app.writes("--html", options->html, OutputKind::words,
             "write a page with every picture, its render and their difference to this file");
  app.flag("--mirrored", options->settings.mirrored, "look at the mirror image of every picture as well");
  background_option(app, options->behind);
  app.flag("--whole-images", options->whole_images,
           "look at image files whole, also at pages of which the picture would be looked at alone");
  app.number("--memory-budget", options->memory_budget_mb, WholeRange{1, 1 << 24},
             "MiB of memory for reading one image; larger ones are refused before they are decoded")
      ->capture_default_str();
  app.number(
         "--places", options->settings.places, WholeRange{1, 5000},
         "cameras that a picture is compared with: the model's, then drawn ones between and beyond (of splats whose up "
         "nobody said, a third of that about each of six axes)")
      ->capture_default_str();
  add_splat_up(app, options->settings.up, "any of these six");
  app.number("--seed", options->settings.seed, any_seed, "seed of the drawn ones")->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
