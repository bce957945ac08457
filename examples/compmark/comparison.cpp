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
#include "reading.hpp"

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
  Result<Evaluation> evaluation =
      evaluate_views(*opened.model, opened.views, input.lpips, executor, [&](const SeenView& view) {
        if (failure) return;
        for (std::size_t s = 0; s < shown; ++s) {
          if (view.index == s * count / shown)
            found.views.push_back({view.result.name + ", " + path.filename().string(), make_report_image(view.truth),
                                   make_report_image(view.measured), view.result.psnr, view.result.ssim,
                                   view.result.lpips_alex});
        }
        if (reader != nullptr) {
          Result<ViewLogits> logits =
              read_logits(reader->decoder, view.render, view.result.name, reader->context, executor);
          if (!logits) {
            failure = logits.error();
            return;
          }
          read.push_back(std::move(*logits));
        }
        if (twin == nullptr) return;
        const Result<RenderedView> plain =
            twin->model->render(twin->views.camera(view.index), twin->views.lens(view.index), executor);
        if (!plain) {
          failure = plain.error();
          return;
        }
        round_to_8bit<float>(plain->image, plain->image);
        found.psnr_vs_unmarked.push_back(psnr(view.render, ImageView<const float>(plain->image)));
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

}  // namespace tool
