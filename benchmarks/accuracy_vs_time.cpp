// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What accuracy costs in time. Renders one trained model (or a synthetic scene) from a few views with every accuracy
// preset and with every single knob turned away from `standard`, and compares image and gradient with two references in
// double, never mixed: exact (no cut-offs) and spec (the published constants).
//
//   accuracy_vs_time [MODEL.safetensors] [--views N] [--repetitions N] [--threads N] [--json FILE] [--html FILE] [--svg
//     FILE] [--splats N] [--size N]
//
// Time is the median over the repetitions of the mean over the views; the cases are interleaved, so that a slow moment
// of the machine hits all of them; with --threads 1 it is processor time. Bytes are counted by this program's own
// operator new. The rows are in support/accuracy_cases.hpp.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../examples/compmark/plain_page.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/anchor/visibility.hpp"
#include "compmark/splat/training/model_file.hpp"
#include "support/accuracy_cases.hpp"
#include "support/accuracy_rows.hpp"
#include "support/live_bytes.hpp"

namespace {

using namespace accuracy_bench;

// ---- scenes ---------------------------------------------------------------------------------------------------------

void finish_view(BenchView& view) {
  const std::size_t count = view.gaussians.size();
  view.gaussians_double.resize(count);
  const auto copy = [&](const float* from, double* to) { std::copy_n(from, count, to); };
  const GaussianColumns<const float> g = std::as_const(view.gaussians).columns();
  const GaussianColumns<double> d = view.gaussians_double.columns();
  for (std::size_t i = 0; i < 3; ++i)
    copy(g.mean[i], d.mean[i]), copy(g.scale[i], d.scale[i]), copy(g.color[i], d.color[i]);
  for (std::size_t i = 0; i < 4; ++i) copy(g.rotation[i], d.rotation[i]);
  copy(g.opacity, d.opacity);
  const std::size_t width = static_cast<std::size_t>(view.camera.width),
                    height = static_cast<std::size_t>(view.camera.height);
  view.d_image.resize(3 * width * height);
  const Random random(7, 0, random_stage("accuracy_vs_time loss"));
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t y = 0; y < height; ++y) {
      for (std::size_t x = 0; x < width; ++x) {
        const bool up = (random.bits((c * height + y / 4) * width + x / 4) & 1) != 0;
        view.d_image[(c * height + y) * width + x] = (up ? 1.0 : -1.0) / static_cast<double>(view.d_image.size());
      }
    }
  }
}

/// Views of a scene of splats alone: log-normal anisotropic footprints, white background.
std::vector<BenchView> synthetic_views(std::size_t splats, int size) {
  scene.background = {1, 1, 1};
  const Random random(1, 0, random_stage("accuracy_vs_time scene"));
  std::vector<BenchView> views(2);
  for (std::size_t v = 0; v < views.size(); ++v) {
    BenchView& view = views[v];
    view.name = "synthetic " + std::to_string(v);
    view.camera.width = view.camera.height = size;
    view.camera.fx = view.camera.fy = 1.2 * size;
    view.camera.cx = view.camera.cy = 0.5 * size;
    const double angle = 0.5 * static_cast<double>(v);
    view.camera.rotation_camera_world = {std::cos(angle),  0, std::sin(angle), 0, 1, 0,
                                         -std::sin(angle), 0, std::cos(angle)};
    view.camera.center_world = {-4 * -std::sin(angle), 0, -4 * std::cos(angle)};
    view.gaussians.resize(splats);
    const GaussianColumns<float> g = view.gaussians.columns();
    const double unit = 0.02 * std::cbrt(6e4 / static_cast<double>(splats));
    for (std::size_t i = 0; i < splats; ++i) {
      const std::uint64_t key = 32 * i;
      std::array<double, 4> q{};
      double norm = 0;
      for (std::uint64_t k = 0; k < 4; ++k) q[k] = random.normal(key + k), norm += q[k] * q[k];
      for (std::uint64_t k = 0; k < 4; ++k) g.rotation[k][i] = static_cast<float>(q[k] / std::sqrt(norm));
      for (std::uint64_t k = 0; k < 3; ++k) {
        g.mean[k][i] = static_cast<float>(2.6 * (random.uniform(key + 4 + k) - 0.5));
        g.scale[k][i] = static_cast<float>(unit * std::exp(0.7 * random.normal(key + 8 + k)));
        g.color[k][i] = static_cast<float>(random.uniform(key + 12 + k));
      }
      g.opacity[i] = static_cast<float>(random.uniform(key + 16));
    }
    finish_view(view);
  }
  return views;
}

/// Test views of a trained model (all views where it has no test views), evenly spread.
template <Recipe R>
Result<std::vector<BenchView>> model_views(const std::filesystem::path& path, std::size_t wanted) {
  Result<LoadedModel<R>> loaded = read_model<R>(path);
  if (!loaded) return loaded.error();
  const Model<R>& model = loaded->model;
  scene = {model.render.near_plane, model.render.blur_variance, model.render.background};
  std::vector<const StoredView*> candidates;
  for (const StoredView& view : loaded->info.views) {
    if (view.test) candidates.push_back(&view);
  }
  if (candidates.empty()) {
    for (const StoredView& view : loaded->info.views) candidates.push_back(&view);
  }
  if (candidates.empty())
    return Error{ErrorKind::invalid, path.string(), "views", "the model has no cameras",
                 "train it again with this version"};
  const std::size_t count = std::min(std::max<std::size_t>(1, wanted), candidates.size());
  std::vector<BenchView> views(count);
  const typename R::GaussianDecoder decoder{};
  typename R::GaussianDecoder::Context context;
  Buffer<std::uint32_t> visible;
  VisibilityWorkspace workspace;
  for (std::size_t i = 0; i < count; ++i) {
    const StoredView& stored = *candidates[i * candidates.size() / count];
    views[i].name = stored.name;
    views[i].camera = stored.camera;
    visible_anchors(model.columns(), stored.camera.template cast<float>(),
                    {model.render.near_plane, model.render.blur_variance}, visible, workspace, *executor);
    decoder.forward(model.columns(), std::as_const(visible).span(), stored.camera.center_world, 0, model.arena,
                    model.decoder, views[i].gaussians, context, *executor);
    finish_view(views[i]);
  }
  return views;
}

Result<std::vector<BenchView>> load_views(const std::filesystem::path& path, std::size_t wanted) {
  const Result<SafetensorsFile> file = read_safetensors(path);
  if (!file) return file.error();
  const Result<std::string> recipe = model_recipe(*file);
  if (!recipe) return recipe.error();
  Result<std::vector<BenchView>> views = model_views<recipes::Scaffold>(path, wanted);
  if (views) return views;
  if (Result<std::vector<BenchView>> unmarked = model_views<recipes::CompMarkBase>(path, wanted); unmarked)
    return unmarked;
  if (Result<std::vector<BenchView>> unmarked = model_views<recipes::CompMarkPaperBase>(path, wanted); unmarked)
    return unmarked;
  return views;
}

/// TileRasterizer<double> stands in for the slow ReferenceRasterizer; here it is compared with it on a crop of every
/// view.
template <Accuracy accuracy>
std::string prove_reference(const std::vector<BenchView>& views, int crop) {
  double image_error = 0, gradient_error = 0;
  for (const BenchView& whole : views) {
    BenchView view;
    const int size = std::min({crop, whole.camera.width, whole.camera.height});
    view.camera = whole.camera.cropped((whole.camera.width - size) / 2, (whole.camera.height - size) / 2, size, size);
    view.gaussians = whole.gaussians;
    finish_view(view);
    RasterCase<TileRasterizer<double, accuracy>> tile("", "", "");
    RasterCase<ReferenceRasterizer<double, accuracy>> reference("", "", "");
    for (Case* one : {static_cast<Case*>(&tile), static_cast<Case*>(&reference)}) {
      one->forward(view);
      one->backward(view);
    }
    const Rendered a = tile.rendered(view), b = reference.rendered(view);
    Difference image;
    image.add(a.image, b.image);
    image_error = std::max(image_error, image.largest);
    for (std::size_t group = 0; group < 5; ++group) {
      GradientDifference gradient;
      for (std::size_t c = group_columns[group][0]; c < group_columns[group][1]; ++c)
        gradient.add(a.gradient[c], b.gradient[c]);
      if (gradient.rr > 0) gradient_error = std::max(gradient_error, gradient.relative());
    }
  }
  return tool::format_text("image %.1e, gradient %.1e", image_error, gradient_error);
}

std::string bytes_text(std::ptrdiff_t bytes) { return tool::format_text("%.1f", static_cast<double>(bytes) / 1e6); }

struct Options {
  std::filesystem::path model, json, html, svg;
  std::size_t views = 4, splats = 60000, threads = 0;
  int repetitions = 7, size = 512;
};

std::optional<Options> parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    const auto value = [&]() -> const char* { return i + 1 < argc ? argv[++i] : ""; };
    if (argument == "--views") {
      options.views = std::strtoul(value(), nullptr, 10);
    } else if (argument == "--repetitions") {
      options.repetitions = std::max(1, std::atoi(value()));
    } else if (argument == "--threads") {
      options.threads = std::strtoul(value(), nullptr, 10);
    } else if (argument == "--splats") {
      options.splats = std::max(1ul, std::strtoul(value(), nullptr, 10));
    } else if (argument == "--size") {
      options.size = std::clamp(std::atoi(value()), 16, 8192);
    } else if (argument == "--json") {
      options.json = value();
    } else if (argument == "--html") {
      options.html = value();
    } else if (argument == "--svg") {
      options.svg = value();
    } else if (argument.substr(0, 2) == "--" || !options.model.empty()) {
      std::fprintf(stderr,
                   "usage: accuracy_vs_time [MODEL.safetensors] [--views N] [--repetitions N] [--threads N] [--json "
                   "FILE] [--html FILE] [--svg FILE] "
                   "[--splats N] [--size N]\n");
      return std::nullopt;
    } else {
      options.model = argument;
    }
  }
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  const std::optional<Options> options = parse(argc, argv);
  if (!options) return 2;
  ThreadExecutor threads(options->threads);
  executor = &threads;
  std::vector<BenchView> views;
  if (options->model.empty()) {
    views = synthetic_views(options->splats, options->size);
  } else {
    Result<std::vector<BenchView>> loaded = load_views(options->model, options->views);
    if (!loaded) {
      std::fprintf(stderr, "accuracy_vs_time: %s\n", loaded.error().line().c_str());
      return 1;
    }
    views = std::move(*loaded);
  }
  double gaussians = 0;
  for (const BenchView& view : views)
    gaussians += static_cast<double>(view.gaussians.size()) / static_cast<double>(views.size());
  std::string head = tool::format_text(
      "%s: %zu views of %d x %d, %.0f Gaussians a view, %s, median of %d repetitions, interleaved",
      options->model.empty() ? "synthetic scene" : options->model.filename().c_str(), views.size(),
      views[0].camera.width, views[0].camera.height, gaussians,
      threads.concurrency() == 1 ? "1 thread, processor time"
                                 : (std::to_string(threads.concurrency()) + " threads, wall clock").c_str(),
      options->repetitions);
  std::printf("%s\n", head.c_str());
  const std::string proof =
      "References: TileRasterizer<double>. Largest difference to ReferenceRasterizer<double> on the central 48 x 48 "
      "pixels of every view: exact: " +
      prove_reference<accuracy::exact>(views, 48) + "; spec: " + prove_reference<accuracy::spec>(views, 48) + ".";
  std::printf("%s\n\n", proof.c_str());

  // Warm-up, and everything that is not time. The references first; they keep no context.
  Cases cases = all_cases();
  std::vector<Row> rows(cases.size());
  std::vector<Rendered> exact, spec;
  const int reference_repetitions = std::min(options->repetitions, 2);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const std::ptrdiff_t before = live_bytes.load();
    const bool reference = cases[i]->group == "reference";
    for (std::size_t v = 0; v < views.size(); ++v) {
      cases[i]->forward(views[v]);
      cases[i]->backward(views[v]);
      rows[i].pairs += static_cast<double>(cases[i]->pairs()) / static_cast<double>(views.size());
      Rendered rendered = cases[i]->rendered(views[v]);
      if (cases[i]->name == "exact") exact.push_back(std::move(rendered));
      if (cases[i]->name == "spec") spec.push_back(std::move(rendered));
      const Rendered& current = cases[i]->name == "exact" ? exact[v] : (cases[i]->name == "spec" ? spec[v] : rendered);
      rows[i].to_exact.add(current.image, exact[v].image);
      if (!spec.empty()) rows[i].to_spec.add(current.image, spec[v].image);
      for (std::size_t group = 0; group < 5; ++group) {
        for (std::size_t c = group_columns[group][0]; c < group_columns[group][1]; ++c) {
          rows[i].gradient[group].add(current.gradient[c], exact[v].gradient[c]);
        }
      }
    }
    const std::ptrdiff_t stored =
        reference ? static_cast<std::ptrdiff_t>(views.size() * (3 * 8 * views[0].d_image.size() / 3)) : 0;
    rows[i].bytes = live_bytes.load() - before - stored;
    if (reference) {
      for (int repetition = 0; repetition < reference_repetitions; ++repetition) {
        double forward = 0, backward = 0;
        for (const BenchView& view : views) forward += cases[i]->forward(view), backward += cases[i]->backward(view);
        rows[i].forward_ms.push_back(forward / static_cast<double>(views.size()));
        rows[i].backward_ms.push_back(backward / static_cast<double>(views.size()));
      }
      cases[i]->drop();
    }
  }
  for (std::size_t v = 0; v < views.size(); ++v) rows[0].to_spec.add(exact[v].image, spec[v].image);

  for (int repetition = 0; repetition < options->repetitions; ++repetition) {
    for (std::size_t i = 0; i < cases.size(); ++i) {
      if (cases[i]->group == "reference") continue;
      double forward = 0, backward = 0;
      for (const BenchView& view : views) forward += cases[i]->forward(view), backward += cases[i]->backward(view);
      rows[i].forward_ms.push_back(forward / static_cast<double>(views.size()));
      rows[i].backward_ms.push_back(backward / static_cast<double>(views.size()));
    }
  }

  // The Pareto front: no other case is both faster and closer to exact.
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (cases[i]->group != "reference") order.push_back(i);
  }
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return rows[a].total() < rows[b].total(); });
  std::vector<std::size_t> front;
  for (const std::size_t i : order) {
    if (front.empty() || rows[i].to_exact.psnr() > rows[front.back()].to_exact.psnr() + 0.01) front.push_back(i);
  }

  std::size_t standard = 0;
  for (std::size_t i = 0; i < cases.size(); ++i) standard = cases[i]->name == "standard" ? i : standard;
  tool::Table table{{"case", "ms forward", "ms backward", "x standard", "PSNR exact", "max exact", "PSNR spec",
                     "max spec", "grad rel L2", "grad 1-cos", "grad bias", "MB", "pairs/1000", "Pareto"},
                    {}};
  nlohmann::ordered_json json{{"schema", 1},
                              {"model", options->model.filename().string()},
                              {"views", views.size()},
                              {"width", views[0].camera.width},
                              {"height", views[0].camera.height},
                              {"gaussians_per_view", gaussians},
                              {"threads", threads.concurrency()},
                              {"repetitions", options->repetitions},
                              {"reference_check", proof},
                              {"cases", nlohmann::ordered_json::array()}};
  const auto decibels = [](double value) { return value >= 300 ? std::string("-") : tool::format_text("%.1f", value); };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Row& row = rows[i];
    const bool on_front = std::find(front.begin(), front.end(), i) != front.end();
    table.rows.push_back(
        {cases[i]->name, tool::format_text("%.1f", row.forward()), tool::format_text("%.1f", row.backward()),
         tool::format_text("%.2f", row.total() / rows[standard].total()), decibels(row.to_exact.psnr()),
         tool::format_text("%.1e", row.to_exact.largest), decibels(row.to_spec.psnr()),
         tool::format_text("%.1e", row.to_spec.largest), tool::format_text("%.1e", row.relative()),
         tool::format_text("%.1e", 1 - row.cosine()), tool::format_text("%+.1e", row.bias()), bytes_text(row.bytes),
         tool::format_text("%.0f", row.pairs / 1e3), on_front ? "*" : ""});
    nlohmann::ordered_json groups;
    for (std::size_t g = 0; g < 5; ++g) {
      groups[group_names[g]] = {{"relative_l2", row.gradient[g].relative()},
                                {"cosine", row.gradient[g].cosine()},
                                {"bias", row.gradient[g].bias()}};
    }
    json["cases"].push_back({{"name", cases[i]->name},
                             {"group", cases[i]->group},
                             {"note", cases[i]->note},
                             {"forward_ms", row.forward()},
                             {"backward_ms", row.backward()},
                             {"psnr_exact", row.to_exact.psnr()},
                             {"max_error_exact", row.to_exact.largest},
                             {"psnr_spec", row.to_spec.psnr()},
                             {"max_error_spec", row.to_spec.largest},
                             {"gradient", groups},
                             {"bytes", row.bytes},
                             {"pairs", row.pairs},
                             {"pareto", on_front}});
  }
  std::printf("%s\nPareto front, fastest first:", table.markdown().c_str());
  for (const std::size_t i : front)
    std::printf(" %s (%.1f ms, %.1f dB);", cases[i]->name.c_str(), rows[i].total(), rows[i].to_exact.psnr());
  std::printf("\n");

  if (!options->json.empty()) {
    if (const Result<Done> written = write_json(options->json, json); !written) {
      std::fprintf(stderr, "accuracy_vs_time: %s\n", written.error().line().c_str());
      return 1;
    }
  }
  if (!options->html.empty() || !options->svg.empty()) {
    tool::Plot plot{.title = "Closeness to exact against time",
                    .x_label = "ms forward + backward",
                    .y_label = "PSNR against exact, dB",
                    .series = {},
                    .log_x = true,
                    .width = 860,
                    .height = 520};
    tool::PlotSeries line{.label = "Pareto front", .points = {}, .names = {}, .color = 5};
    for (const std::size_t i : front) line.points.push_back({rows[i].total(), rows[i].to_exact.psnr()});
    plot.series.push_back(line);
    int color = 0;
    for (const char* group : {"preset", "knob", "ladder"}) {
      tool::PlotSeries series{.label = group, .points = {}, .names = {}, .color = color++, .line = false, .dots = true};
      series.names_left = series.label == "knob";
      for (std::size_t i = 0; i < cases.size(); ++i) {
        if (cases[i]->group != group) continue;
        series.points.push_back({rows[i].total(), rows[i].to_exact.psnr()});
        const bool named = cases[i]->group == "preset" || std::find(front.begin(), front.end(), i) != front.end();
        series.names.push_back(named ? cases[i]->name : "");
      }
      plot.series.push_back(std::move(series));
    }
    const std::string page = tool::html_page("Accuracy against time", head, {plot}, proof, table);
    if (const Result<Done> written = tool::write_pages(options->html, options->svg, page, {plot}); !written) {
      std::fprintf(stderr, "accuracy_vs_time: %s\n", written.error().line().c_str());
      return 1;
    }
  }
  return 0;
}
