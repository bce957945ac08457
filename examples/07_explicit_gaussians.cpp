// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Gaussians without anchors' networks: trains a scene, writes it as a 3DGS file that any viewer shows, reads that file
// back as a model, and renders a view that was not trained on from both: the same picture.
//   07_explicit_gaussians [dataset folder] [iterations] [downscale]   without a folder: the built-in scene
#include <algorithm>
#include <compmark/compmark.hpp>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

using Recipe = compmark::recipes::Explicit;

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

struct PrintProgress {
  template <class Trainer>
  bool on_iteration(const Trainer& /*trainer*/, const compmark::IterationReport& report) const {
    if (report.iteration % std::max<std::int64_t>(1, report.total / 6) == 0) {
      std::printf("iteration %lld: loss %.4f, %zu Gaussians\n", static_cast<long long>(report.iteration),
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

int main(int count, char** words) {
  std::string folder = count > 1 ? words[1] : "explicit_scene";
  if (count < 2) {
    compmark::ProceduralSettings scene;
    scene.width = scene.height = 96;
    scene.views_train = 24;
    scene.views_test = 2;
    if (const auto written = compmark::write_procedural_scene(folder, scene); !written) return fail(written.error());
  }
  compmark::TrainSettings settings;
  settings.iterations = count > 2 ? std::atoi(words[2]) : 300;
  settings.voxel_size = count > 1 ? 0.01 : 0.02;
  compmark::DatasetSettings data;
  data.background = settings.background;
  if (count > 3) data.downscale = std::atof(words[3]);
  const auto dataset = compmark::open_dataset(folder, data);
  if (!dataset) return fail(dataset.error());
  compmark::ImageStore store(*dataset, data);
  Views train{&*dataset, &store, dataset->indices(compmark::Split::train)};
  Views test{&*dataset, &store, dataset->indices(compmark::Split::test)};

  compmark::ThreadExecutor threads;
  compmark::Trainer<Recipe, compmark::ThreadExecutor> trainer(settings, train.size(),
                                                              compmark::scene_extent(*dataset).radius, threads);
  if (const auto ready = trainer.initialise(dataset->points.position); !ready) return fail(ready.error());
  if (const auto done = trainer.run(train, PrintProgress{}); !done) return fail(done.error());

  if (const auto written = compmark::write_splat_ply("explicit.ply", compmark::explicit_splats(trainer.model()));
      !written)
    return fail(written.error());
  const auto splats = compmark::read_splat_ply("explicit.ply");
  if (!splats) return fail(splats.error());
  const auto read = compmark::model_from_splats<Recipe>(splats->table, trainer.model().render);
  if (!read) return fail(read.error());

  const compmark::Pipeline<Recipe> pipeline;
  compmark::Pipeline<Recipe>::Context trained, again;
  double to_photographs = 0, to_each_other = 1e9;
  for (std::size_t i = 0; i < test.size(); ++i) {
    pipeline.forward(trainer.model(), test.camera(i), 0, trained, threads);
    pipeline.forward(*read, test.camera(i), 0, again, threads);
    std::vector<float> pixels(trained.image.size());
    const compmark::ImageView<float> truth{pixels.data(), 3, trained.image.height, trained.image.width};
    if (const auto loaded = test.load(i, truth); !loaded) return fail(loaded.error());
    to_photographs += compmark::psnr(trained.image, truth) / static_cast<double>(test.size());
    to_each_other = std::min(to_each_other, compmark::psnr(trained.image, again.image));
  }
  std::printf("%zu views that were not trained on: %.2f dB; the file against the model: %.0f dB or more\n", test.size(),
              to_photographs, to_each_other);
  if (const auto written = compmark::write_png("explicit.png", trained.image); !written) return fail(written.error());
  return to_photographs > 18 && to_each_other > 80 ? 0 : 1;
}
