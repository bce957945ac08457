// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "comparison.hpp"

#include <algorithm>
#include <compmark/mark/key.hpp>
#include <compmark/mark/message.hpp>
#include <compmark/mark/report.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/metric/ssim.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <set>

#include "coded_run.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "lpips_nets.hpp"
#include "mark_record.hpp"
#include "reading.hpp"

namespace tool {
namespace {

using namespace compmark;

/// A model with the photographs as its own lens, unit and background want them.
struct Opened {
  std::filesystem::path path;
  std::optional<AnyModel> model;
  Dataset dataset;
  std::unique_ptr<ImageStore> store;
  DatasetViews views;
};

Result<std::unique_ptr<Opened>> open_model(const std::filesystem::path& path, const ComparisonInput& input,
                                           std::set<std::string>& warned) {
  auto opened = std::make_unique<Opened>();
  opened->path = path;
  Result<AnyModel> model = load_model(path, input.threads);
  if (!model) return model.error();
  opened->model = std::move(*model);
  DatasetSettings settings = settings_of(opened->model->info());
  settings.downscale = input.downscale;
  for (std::size_t c = 0; c < 3; ++c)
    settings.background[c] = static_cast<float>(opened->model->render_settings().background[c]);
  Result<Dataset> dataset = open_for(opened->model->info(), input.data, settings);
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
                 "--key and --decoder are needed together to read a message"};
  }
  const Result<OwnerKey> key = load_key(input.key);
  if (!key) return key.error();
  if (const Result<Done> recorded = check_recorded(input.key, *key, input.decoder); !recorded)
    std::fprintf(stderr, "compmark: warning: %s: %s\n", input.decoder.string().c_str(),
                 recorded.error().problem.c_str());
  Result<Decoder> decoder = load_decoder(input.decoder, &*key);
  if (!decoder) return decoder.error();
  auto reader = std::make_unique<Reader>();
  reader->decoder = std::move(*decoder);
  reader->message = message_of(*key);
  return reader;
}

/// This view of a model against the counterpart's render of it.
Result<AgainstTwin> measure_against(Opened& twin, const SeenView& view, LpipsNets& nets, ThreadExecutor& executor) {
  const Result<RenderedView> plain =
      twin.model->render(twin.views.camera(view.index), twin.views.lens(view.index), executor);
  if (!plain) return plain.error();
  round_to_8bit<float>(plain->image, plain->image);
  const ImageView<const float> reference(plain->image);
  Result<LpipsNets::Distances> distances = nets.between(view.render, reference, executor);
  if (!distances) return distances.error();
  return AgainstTwin{psnr(view.render, reference), ssim(view.render, reference), distances->alex, distances->squeeze};
}

Result<ComparedModel> measure(Opened& opened, Opened* twin, Reader* reader, LpipsNets& nets,
                              const ComparisonInput& input, ThreadExecutor& executor) {
  const std::filesystem::path& path = opened.path;
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
            found.views.push_back({view.result.name, make_report_image(view.truth), make_report_image(view.measured),
                                   view.result.psnr, view.result.ssim, view.result.lpips_alex});
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
        Result<AgainstTwin> against = measure_against(*twin, view, nets, executor);
        if (against)
          found.against_twin.push_back(*against);
        else
          failure = against.error();
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
          "differ, in number, place or size, from those of " + first.string(), "compare models of one capture"};
}
/// Whether two models are rendered at the same views, pixel by pixel.
Result<Done> check_views(const Opened& opened, const Opened& twin) {
  bool same = opened.views.size() == twin.views.size();
  for (std::size_t i = 0; same && i < opened.views.size(); ++i) {
    const Camera<double> a = opened.views.camera(i), b = twin.views.camera(i);
    same = a.width == b.width && a.height == b.height;
  }
  if (!same) return other_views(opened.path, twin.path);
  return Done{};
}

bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code none;
  return std::filesystem::equivalent(a, b, none);
}

/// Unmarked counterparts, each file once, and which of them a model has.
struct Twins {
  std::vector<std::unique_ptr<Opened>> opened;
  std::vector<std::size_t> of_model;  ///< empty without twins
};
Result<Twins> open_twins(const ComparisonInput& input, std::set<std::string>& warned) {
  Twins twins;
  if (input.unmarked.empty()) return twins;
  if (input.unmarked.size() != 1 && input.unmarked.size() != input.models.size()) {
    return Error{ErrorKind::invalid,
                 {},
                 "--unmarked",
                 "names " + std::to_string(input.unmarked.size()) + " files for " +
                     std::to_string(input.models.size()) + (input.models.size() == 1 ? " model" : " models"),
                 "give one counterpart for all models, or one for each in the order of --model"};
  }
  for (std::size_t m = 0; m < input.models.size(); ++m) {
    const std::filesystem::path& path = input.unmarked.size() == 1 ? input.unmarked[0] : input.unmarked[m];
    const auto known = std::find_if(twins.opened.begin(), twins.opened.end(), [&](const std::unique_ptr<Opened>& twin) {
      return twin->path == path || same_file(twin->path, path);
    });
    twins.of_model.push_back(static_cast<std::size_t>(known - twins.opened.begin()));
    if (known != twins.opened.end()) continue;
    Result<std::unique_ptr<Opened>> opened = open_model(path, input, warned);
    if (!opened) return opened.error();
    twins.opened.push_back(std::move(*opened));
  }
  return twins;
}

/// Names by which people tell the models apart: model.safetensors lies in every run.
void name_models(std::vector<ComparedModel>& models) {
  const auto last = [](const std::filesystem::path& path, std::size_t parts) {
    std::filesystem::path name, rest = std::filesystem::absolute(path).lexically_normal();
    for (; parts > 0 && rest.has_filename(); --parts, rest = rest.parent_path())
      name = name.empty() ? rest.filename() : rest.filename() / name;
    return name.string();
  };
  for (ComparedModel& model : models) {
    for (std::size_t parts = 1; parts < 32; ++parts) {
      model.name = last(model.path, parts);
      if (std::none_of(models.begin(), models.end(), [&](const ComparedModel& other) {
            return &other != &model && last(other.path, parts) == model.name;
          }))
        break;
    }
  }
}

}  // namespace

Result<Comparison> compare_models(const ComparisonInput& input, ThreadExecutor& executor) {
  Comparison comparison;
  comparison.split = input.split;
  const Result<std::unique_ptr<Reader>> reader = open_reader(input);
  if (!reader) return reader.error();
  if (*reader) comparison.message = (*reader)->message;
  Result<LpipsNets> nets = LpipsNets::open(input.lpips);
  if (!nets) return nets.error();
  std::set<std::string> warned;
  Result<Twins> twins = open_twins(input, warned);
  if (!twins) return twins.error();
  std::vector<ComparedModel>& models = comparison.models;
  for (std::size_t m = 0; m < input.models.size(); ++m) {
    const Result<std::unique_ptr<Opened>> opened = open_model(input.models[m], input, warned);
    if (!opened) return opened.error();
    Opened* const twin = twins->opened.empty() ? nullptr : twins->opened[twins->of_model[m]].get();
    if (twin != nullptr) {
      if (Result<Done> same = check_views(**opened, *twin); !same) return same.error();
    }
    if (!models.empty() && models[0].evaluation.views.size() != (*opened)->views.size())
      return other_views(input.models[m], input.models[0]);
    Result<ComparedModel> found = measure(**opened, twin, reader->get(), *nets, input, executor);
    if (!found) return found.error();
    models.push_back(std::move(*found));
  }
  for (std::size_t t = 0; t < twins->opened.size(); ++t) {
    std::unique_ptr<Opened>& twin = twins->opened[t];
    const auto is_twin = [&](const ComparedModel& model) { return same_file(model.path, twin->path); };
    auto place = std::find_if(models.begin(), models.end(), is_twin);
    const std::size_t index = static_cast<std::size_t>(place - models.begin());
    if (place == models.end()) {
      Result<ComparedModel> found = measure(*twin, nullptr, reader->get(), *nets, input, executor);
      if (!found) return found.error();
      models.push_back(std::move(*found));
    }
    models[index].is_unmarked = true;
    twin.reset();  // with its photographs
    for (std::size_t m = 0; m < input.models.size(); ++m) {
      if (twins->of_model[m] == t) models[m].twin = index;
    }
  }
  name_models(models);
  return comparison;
}

}  // namespace tool
