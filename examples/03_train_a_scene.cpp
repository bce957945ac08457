// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A whole training in one program: writes the built-in scene as a dataset, trains on it, renders a view that was not
// trained on. The program owns the clock, the printing and the stopping; the library does the work.
#include <compmark/compmark.hpp>
#include <cstdio>
#include <vector>

namespace {

/// Where the trainer gets its images from: any type with these three members (concept TrainingViews).
struct Views {
  const compmark::Dataset* dataset;
  compmark::ImageStore* store;
  std::vector<std::size_t> index;

  std::size_t size() const { return index.size(); }
  compmark::Camera<double> camera(std::size_t i) const { return dataset->views[index[i]].camera; }
  compmark::Result<compmark::Done> load(std::size_t i, compmark::ImageView<float> image) {
    return store->load(index[i], image);
  }
};

/// Sees every iteration; returning false stops the run.
struct PrintProgress {
  template <class Trainer>
  bool on_iteration(const Trainer& /*trainer*/, const compmark::IterationReport& report) const {
    if (report.iteration % 50 == 0) {
      std::printf("iteration %lld: loss %.4f, %zu anchors\n", static_cast<long long>(report.iteration),
                  report.loss.total, report.anchors);
    }
    return true;
  }
};

int fail(const compmark::Error& error) {
  std::fprintf(stderr, "%s\n", error.line().c_str());
  return 1;
}

}  // namespace

int main() {
  compmark::ProceduralSettings scene;
  scene.width = scene.height = 96;
  scene.views_train = 24;
  scene.views_test = 2;
  if (const auto written = compmark::write_procedural_scene("example_scene", scene); !written)
    return fail(written.error());

  compmark::TrainSettings settings;  // the defaults are those of profile "scaffold"
  settings.iterations = 300;
  settings.voxel_size = 0.02;
  compmark::DatasetSettings data;
  data.background = settings.background;
  const auto dataset = compmark::open_dataset("example_scene", data);
  if (!dataset) return fail(dataset.error());
  compmark::ImageStore store(*dataset, data);
  Views train{&*dataset, &store, dataset->indices(compmark::Split::train)};
  Views test{&*dataset, &store, dataset->indices(compmark::Split::test)};

  compmark::ThreadExecutor threads;
  using Trainer = compmark::Trainer<compmark::recipes::Scaffold, compmark::ThreadExecutor>;
  Trainer trainer(settings, train.size(), compmark::scene_extent(*dataset).radius, threads);
  if (const auto ready = trainer.initialise(dataset->points.position); !ready) return fail(ready.error());
  if (const auto done = trainer.run(train, PrintProgress{}); !done) return fail(done.error());

  const compmark::Pipeline<compmark::recipes::Scaffold> pipeline;
  compmark::Pipeline<compmark::recipes::Scaffold>::Context context;
  pipeline.forward(trainer.model(), test.camera(0), 0, context, threads);
  std::vector<float> pixels(context.image.size());
  const compmark::ImageView<float> truth{pixels.data(), 3, context.image.height, context.image.width};
  if (const auto loaded = test.load(0, truth); !loaded) return fail(loaded.error());
  const double psnr = compmark::psnr(context.image, truth);
  std::printf("a view that was not trained on: %.1f dB\n", psnr);
  if (const auto written = compmark::write_png("render.png", context.image); !written) return fail(written.error());
  compmark::ModelInfo info{"scaffold", "scaffold", settings.iterations, settings.seed, {}, {}};  // what 04 renders
  for (const compmark::View& view : dataset->views)
    info.views.push_back({view.name, view.split == compmark::Split::test, view.camera});
  if (const auto written = compmark::write_model("model.safetensors", trainer.model(), info); !written)
    return fail(written.error());
  return psnr > 18 ? 0 : 1;  // an untrained model is below 12 dB
}
