// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/compare.hpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compare.hpp"
#include "compmark/app/detail/attacked_views.hpp"
#include "compmark/app/detail/capture.hpp"
#include "compmark/app/detail/compress.hpp"
#include "compmark/app/detail/evaluate.hpp"
#include "compmark/app/detail/message_reader.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/io/file_identity.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/metric/ssim.hpp"

namespace compmark {
namespace detail {

/// A model with the photographs as its own lens, unit and background want them.
struct ComparedFile {
  std::filesystem::path path;
  std::optional<AnyModel> model;
  Dataset dataset;
  std::unique_ptr<ImageStore> store;
  DatasetViews views;
};

/// The unmarked counterparts, each file once, and which of them a model has.
struct Counterparts {
  std::vector<std::unique_ptr<ComparedFile>> opened;
  std::vector<std::size_t> of_model;  ///< empty without any
};

[[nodiscard]] inline Error other_views(const std::filesystem::path& path, const std::filesystem::path& first) {
  return {ErrorKind::invalid, path.string(), "views",
          "differ, in number, size or lens, from those of " + first.string(), "compare models of one capture"};
}

/// Names by which people tell the models apart: model.safetensors lies in every run.
inline void name_models(std::vector<ComparedModel>& models) {
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

class ModelComparer {
 public:
  ModelComparer(const CompareSettings& settings, ThreadExecutor& executor, CompareObserver& observer)
      : settings_(settings),
        executor_(executor),
        observer_(observer) {}

  [[nodiscard]] Result<Comparison> run() {
    Comparison comparison;
    comparison.split = settings_.split;
    if (const Result<Done> known = check_attacks(settings_.attacks, settings_.key); !known) return known.error();
    Result<std::unique_ptr<MessageReader>> reader = open_reader(settings_);
    if (!reader) return reader.error();
    reader_ = std::move(*reader);
    if (reader_) comparison.message = reader_->message;
    Result<LpipsNets> nets = LpipsNets::open(settings_.evaluate.lpips);
    if (!nets) return nets.error();
    nets_ = std::move(*nets);
    Result<Counterparts> unmarked = open_unmarked();
    if (!unmarked) return unmarked.error();
    if (const Result<Done> given = measure_given(*unmarked, comparison.models); !given) return given.error();
    if (const Result<Done> others = measure_unmarked(*unmarked, comparison.models); !others) return others.error();
    name_models(comparison.models);
    return comparison;
  }

 private:
  [[nodiscard]] Result<std::unique_ptr<ComparedFile>> open(const std::filesystem::path& path) {
    auto opened = std::make_unique<ComparedFile>();
    opened->path = path;
    Result<AnyModel> model = AnyModel::open(path, executor_);
    if (!model) return model.error();
    opened->model = std::move(*model);
    DatasetSettings capture = settings_of(opened->model->info());
    capture.downscale = settings_.downscale;
    for (std::size_t c = 0; c < 3; ++c)
      capture.background[c] = static_cast<float>(opened->model->render_settings().background[c]);
    Result<Dataset> dataset = open_for(opened->model->info(), settings_.data, capture, executor_);
    if (!dataset) return dataset.error();
    opened->dataset = std::move(*dataset);
    for (const std::string& warning : opened->dataset.warnings) {
      if (warned_.insert(warning).second) observer_.on_warning(warning);
    }
    opened->store = std::make_unique<ImageStore>(opened->dataset, capture);
    opened->views = {&opened->dataset, opened->store.get(), opened->dataset.indices(settings_.split)};
    if (opened->views.size() == 0) {
      return Error{ErrorKind::invalid, settings_.data.string(),
                   settings_.split == Split::test ? "test split" : "train split", "holds no view",
                   "choose the other split with --split"};
    }
    return opened;
  }

  [[nodiscard]] Result<Counterparts> open_unmarked() {
    Counterparts unmarked;
    const std::size_t models = settings_.models.size(), given = settings_.unmarked.size();
    if (given == 0) return unmarked;
    if (given != 1 && given != models) {
      return Error{ErrorKind::invalid,
                   {},
                   "--unmarked",
                   "names " + std::to_string(given) + " files for " + std::to_string(models) +
                       (models == 1 ? " model" : " models"),
                   "give one counterpart for all models, or one for each in the order of --model"};
    }
    for (std::size_t m = 0; m < models; ++m) {
      const std::filesystem::path& path = given == 1 ? settings_.unmarked[0] : settings_.unmarked[m];
      const auto known = std::find_if(unmarked.opened.begin(), unmarked.opened.end(),
                                      [&](const auto& other) { return same_file(other->path, path); });
      unmarked.of_model.push_back(static_cast<std::size_t>(known - unmarked.opened.begin()));
      if (known != unmarked.opened.end()) continue;
      Result<std::unique_ptr<ComparedFile>> opened = open(path);
      if (!opened) return opened.error();
      unmarked.opened.push_back(std::move(*opened));
    }
    return unmarked;
  }

  [[nodiscard]] Result<Done> measure_given(const Counterparts& unmarked, std::vector<ComparedModel>& models) {
    for (std::size_t m = 0; m < settings_.models.size(); ++m) {
      const std::filesystem::path& path = settings_.models[m];
      const Result<std::unique_ptr<ComparedFile>> opened = open(path);
      if (!opened) return opened.error();
      ComparedFile* const counterpart = unmarked.opened.empty() ? nullptr : unmarked.opened[unmarked.of_model[m]].get();
      if (counterpart != nullptr && !same_views((*opened)->views, counterpart->views))
        return other_views(path, counterpart->path);
      if (!models.empty() && models[0].evaluation.views.size() != (*opened)->views.size())
        return other_views(path, settings_.models[0]);
      Result<ComparedModel> found = measure(**opened, counterpart);
      if (!found) return found.error();
      models.push_back(std::move(*found));
    }
    return Done{};
  }

  /// Those that are none of the models are measured too, and all are told from the marked ones.
  [[nodiscard]] Result<Done> measure_unmarked(Counterparts& unmarked, std::vector<ComparedModel>& models) {
    for (std::size_t u = 0; u < unmarked.opened.size(); ++u) {
      std::unique_ptr<ComparedFile>& file = unmarked.opened[u];
      const auto place = std::find_if(models.begin(), models.end(),
                                      [&](const ComparedModel& model) { return same_file(model.path, file->path); });
      const std::size_t index = static_cast<std::size_t>(place - models.begin());
      if (place == models.end()) {
        Result<ComparedModel> found = measure(*file, nullptr);
        if (!found) return found.error();
        models.push_back(std::move(*found));
      }
      models[index].is_unmarked = true;
      file.reset();  // with its photographs
      for (std::size_t m = 0; m < settings_.models.size(); ++m) {
        if (unmarked.of_model[m] == u) models[m].unmarked = index;
      }
    }
    return Done{};
  }

  /// Whether two models are rendered at the same views, pixel by pixel.
  [[nodiscard]] static bool same_views(const DatasetViews& a, const DatasetViews& b) {
    bool same = a.size() == b.size();
    for (std::size_t i = 0; same && i < a.size(); ++i)
      same = a.camera(i).width == b.camera(i).width && a.camera(i).height == b.camera(i).height &&
             (a.lens(i) == b.lens(i) || (is_pinhole(a.lens(i)) && is_pinhole(b.lens(i))));
    return same;
  }

  [[nodiscard]] Result<ComparedModel> measure(ComparedFile& opened, ComparedFile* unmarked) {
    ComparedModel found;
    found.path = opened.path;
    found.bytes = opened.model->file_bytes();
    if (is_coded_file(opened.path)) {
      Result<CodedFile> file = coded_file(opened.path);
      if (!file) return file.error();
      found.codec = file->codec;
      found.sections = std::move(file->sections);
    }
    found.anchors = opened.model->anchor_count();
    observer_.on_model(opened.path, opened.views.size());
    std::vector<ViewLogits> read;
    std::vector<AttackedViews> attacked(settings_.attacks.size());
    Result<Evaluation> evaluation = evaluate_views(
        *opened.model, opened.views, settings_.evaluate, executor_, [&](const SeenView& view) -> Result<Done> {
          if (!observer_.on_view(view)) return stopped();
          if (reader_) {
            Result<ViewLogits> logits = reader_->read(view.render, view.result.name, executor_);
            if (!logits) return logits.error();
            read.push_back(std::move(*logits));
            const Result<Done> after = read_after_attacks(settings_.attacks, view, *reader_, attacked, executor_);
            if (!after) return after;
          }
          return unmarked == nullptr ? Result<Done>(Done{}) : add_against(*unmarked, view, found);
        });
    if (!evaluation) return evaluation.error();
    found.evaluation = std::move(*evaluation);
    if (reader_) {
      Result<Verification> verification = verify_message(reader_->message, read, VerifySettings{});
      if (!verification) return verification.error();
      found.verification = std::move(*verification);
    }
    for (std::size_t a = 0; a < attacked.size(); ++a) {
      Result<Verification> verification = verify_message(reader_->message, attacked[a].read, VerifySettings{});
      if (!verification) return verification.error();
      found.attacked.push_back({settings_.attacks[a], std::move(*verification), attacked[a].mean_psnr()});
    }
    return found;
  }

  /// This view of a model against its counterpart's render of it.
  [[nodiscard]] Result<Done> add_against(ComparedFile& unmarked, const SeenView& view, ComparedModel& found) {
    const Result<RenderedView> plain =
        unmarked.model->render(unmarked.views.camera(view.index), unmarked.views.lens(view.index), executor_);
    if (!plain) return plain.error();
    round_to_8bit<float>(plain->image, plain->image);
    const ImageView<const float> reference(plain->image);
    const Result<LpipsNets::Distances> distances = nets_.between(view.render, reference, executor_);
    if (!distances) return distances.error();
    found.against_unmarked.push_back(
        {psnr(view.render, reference), ssim(view.render, reference), distances->alex, distances->squeeze});
    return Done{};
  }

  const CompareSettings& settings_;
  ThreadExecutor& executor_;
  CompareObserver& observer_;
  std::unique_ptr<MessageReader> reader_;
  LpipsNets nets_;
  std::set<std::string> warned_;
};

}  // namespace detail

COMPMARK_APP_INLINE Result<Comparison> compare_models(const CompareSettings& settings, ThreadExecutor& executor,
                                                      CompareObserver& observer) {
  return detail::ModelComparer(settings, executor, observer).run();
}

}  // namespace compmark
