// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The watermark in a whole pipeline: gradients, what an absent mark costs, and a small training that hides eight bits.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <compmark/watermark/embed/posthoc_embedding.hpp>
#include <compmark/watermark/pretrain/lattice_network.hpp>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/colour_decoder.hpp"
#include "support/directional.hpp"
#include "support/short_training.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;
using compmark::testing::ring_camera;
using compmark::testing::small_shape;
using compmark::testing::SmoothRecipe;

/// A message decoder that fits on a page: bit i is a wave i across the image, z = 400 (m + m^2), m = mean(wave colour).
template <class T>
struct Waves {
  using Scalar = T;
  struct Context {
    std::vector<double> mean;
  };
  static constexpr int bits() { return 8; }
  static constexpr int minimum_size() { return 8; }
  static double wave(int bit, int c, int y, int x, int height, int width) {
    return std::sin((20 + 3 * bit) * (x + 0.5) / width + 5.0 * (8 - bit) * (y + 0.5) / height + 2.0 * c + bit);
  }
  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context& context, E& /*executor*/) const {
    context.mean.assign(8, 0.0);
    for (int bit = 0; bit < 8; ++bit) {
      double sum = 0;
      for (int c = 0; c < 3; ++c) {
        for (int y = 0; y < image.height; ++y) {
          for (int x = 0; x < image.width; ++x) {
            sum += wave(bit, c, y, x, image.height, image.width) * static_cast<double>(image(c, y, x));
          }
        }
      }
      const double m = sum / static_cast<double>(image.size());
      context.mean[static_cast<std::size_t>(bit)] = m;
      logits[static_cast<std::size_t>(bit)] = static_cast<T>(400 * (m + m * m));
    }
  }
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& context, E& /*executor*/) const {
    for (int bit = 0; bit < 8; ++bit) {
      const std::size_t i = static_cast<std::size_t>(bit);
      const double slope =
          static_cast<double>(d_logits[i]) * 400 * (1 + 2 * context.mean[i]) / static_cast<double>(d_image.size());
      for (int c = 0; c < 3; ++c) {
        for (int y = 0; y < d_image.height; ++y) {
          for (int x = 0; x < d_image.width; ++x) {
            d_image(c, y, x) += static_cast<T>(slope * wave(bit, c, y, x, d_image.height, d_image.width));
          }
        }
      }
    }
  }
};
static_assert(MessageDecoder<Waves<float>>);

using Base = compmark::testing::SmallRecipe;
using MarkedSmall = recipes::Marked<Base, Waves<float>>;
const std::vector<std::uint8_t> hidden_message{1, 0, 0, 1, 1, 1, 0, 1};

}  // namespace

TEST_CASE_TEMPLATE("embed/watermark: the directional derivative of the marked pass equals central differences", R,
                   recipes::Marked<SmoothRecipe, Waves<double>>,
                   recipes::MarkedForCompression<SmoothRecipe, Waves<double>>) {
  Model<R> model = compmark::testing::random_model<R>(24);
  model.initialise_stages(4);
  const Random residual(8, 0, random_stage("test residual"));
  for (const char* name : {"anchor.residual", "distortion.2.weight"}) {
    const BlockHandle block = model.arena.layout().find(name);
    if (!block.valid()) continue;
    for (double& value : model.arena.values(block).flat()) {
      value = 0.3 * residual.normal(static_cast<std::uint64_t>(&value - model.arena.values(block).data));
    }
  }
  const Camera<double> camera = ring_camera(1, 5, 37, 29);
  Buffer<double> target_storage(3 * 37 * 29);
  const Random random(5, 0, random_stage("test target"));
  for (std::size_t i = 0; i < target_storage.size(); ++i) target_storage[i] = 1.5 + random.uniform(i);
  const ImageView<const double> target{target_storage.data(), 3, 29, 37};

  Pipeline<R> pipeline;
  pipeline.template stage<MessageStage>().message = hidden_message;
  pipeline.template stage<MessageStage>().message_loss.settings.logit_scale = 1;
  pipeline.template stage<HsvStage>().image_loss.settings.source =
      HueSource::target;  // masks of the render would jump under the differences
  SerialExecutor executor;
  using Context = typename Pipeline<R>::Context;
  typename Pipeline<R>::Phases phases;
  phases.template of<MessageStage>().weight = 0.5;
  phases.template of<HsvStage>().weight = 0.6;
  if constexpr (present<typename R::DistortionLayer>) {
    DistortionPhase& noise = phases.template of<DistortionStage>();
    noise.adaptive = true;
    noise.scaling = 0.001;
    noise.offset = 0.2;
    noise.iteration = 3;
  }
  compmark::testing::check_directional_derivative(
      model,
      [&](Context& context) {
        static_cast<void>(pipeline.forward(model, camera, 1, context, executor, phases));
        return pipeline.loss(target, {0.2, 0.01, 10}, context, executor).total;
      },
      [&](Context& context) { pipeline.backward(model, camera, 1, context, executor); });
}

TEST_CASE(
    "embed/watermark: with a residual of zero and no weights a marked recipe renders and learns what its base does, "
    "to the bit") {
  const auto run = [](auto recipe) {
    using R = decltype(recipe);
    TrainSettings settings;
    settings.iterations = 12;
    settings.voxel_size = 0.05;
    settings.mark.message.lambda = settings.mark.hsv.lambda = 0;
    settings.mark.residual.after = 30000;  // the residual has a learning rate, but not yet
    ThreadExecutor executor(2);
    Trainer<R, ThreadExecutor> trainer(settings, 6, 1.0, executor);
    if constexpr (present<typename R::MessageDecoder>) set_watermark(trainer, Waves<float>{}, hidden_message);
    REQUIRE(trainer.initialise(cloud(300, 7)));
    BlobViews views;
    REQUIRE(trainer.run(views));
    std::vector<float> image(trainer.image().flat().begin(), trainer.image().flat().end());
    const MatrixView<const float> feature = trainer.model().columns().feature;
    image.insert(image.end(), feature.data, feature.data + feature.size());
    return image;
  };
  CHECK(run(MarkedSmall{}) == run(Base{}));
}

TEST_CASE("embed/watermark: what a recipe without a mark does not have") {
  static_assert(Pipeline<Base>::Stages::count == 0);
  static_assert(sizeof(Pipeline<Base>) == sizeof(Base::GaussianDecoder));
  static_assert(sizeof(Pipeline<MarkedSmall>) > sizeof(Base::GaussianDecoder));
  static_assert(sizeof(Model<Base>) < sizeof(Model<MarkedSmall>));
  Model<Base> base;
  base.create(10, 1);
  Model<MarkedSmall> marked;
  marked.create(10, 1);
  CHECK(marked.arena.all_values().size() == base.arena.all_values().size() + 10 * small_shape.feature_dim);
  CHECK_FALSE(base.arena.layout().find("anchor.residual").valid());
}

namespace {

struct MarkOutcome {
  double accuracy = 0, psnr = 0;
};
template <class R>
MarkOutcome train(bool marked, std::vector<float>* bits_of_model = nullptr, std::size_t threads = 2,
                  std::int64_t novel_view_every = 0) {
  TrainSettings settings;
  settings.iterations = compmark::testing::short_trainings ? 30 : 600;
  settings.voxel_size = 0.05;
  settings.seed = 2;
  settings.mark.message.lambda = marked ? 0.05 : 0;
  settings.mark.message.after = 6000;
  settings.mark.message.ramp = 3000;
  settings.mark.message.logit_scale = 1;
  settings.mark.distortion.scaling_noise = 1e-4;
  settings.mark.message.novel_view_every = novel_view_every;
  if (novel_view_every != 0) {
    settings.mark.message.hinge_margin = 1;
    // The waves of this decoder stand still, and the sampled cameras are turned and zoomed: that takes longer to learn.
    if (!compmark::testing::short_trainings) settings.iterations = 1500;
  }
  ThreadExecutor executor(threads);
  Trainer<R, ThreadExecutor> trainer(settings, 6, 1.0, executor);
  if constexpr (present<typename R::MessageDecoder>) set_watermark(trainer, Waves<float>{}, hidden_message);
  REQUIRE(trainer.initialise(cloud(400, 7)));
  BlobViews views;
  REQUIRE(trainer.run(views));
  // Read from renders of the baked model, as whoever checks the mark does.
  const Model<Base> base = baked_model(trainer.model());
  const Pipeline<Base> pipeline;
  Pipeline<Base>::Context context;
  MarkOutcome outcome;
  std::vector<float> target(3 * 48 * 40), logits(8);
  for (std::size_t v = 0; v < views.size(); ++v) {
    static_cast<void>(pipeline.forward(base, views.camera(v), v, context, executor));
    const ImageView<float> wanted{target.data(), 3, 40, 48};
    static_cast<void>(views.load(v, wanted));
    double square = 0;
    for (std::size_t i = 0; i < target.size(); ++i) {
      square += std::pow(static_cast<double>(context.image.data[i]) - static_cast<double>(target[i]), 2);
    }
    outcome.psnr += -10 * std::log10(square / static_cast<double>(target.size())) / static_cast<double>(views.size());
    typename Waves<float>::Context wave_context;
    Waves<float>{}.forward(context.image, logits, wave_context, executor);
    for (std::size_t i = 0; i < 8; ++i) {
      outcome.accuracy += (logits[i] > 0) == (hidden_message[i] == 1) ? 1.0 / 8 / static_cast<double>(views.size()) : 0;
    }
  }
  if (bits_of_model != nullptr) {
    bits_of_model->assign(base.arena.all_values().begin(), base.arena.all_values().end());
  }
  return outcome;
}

}  // namespace

TEST_CASE("embed/watermark: eight bits are hidden and read from every render; without the message they are not there") {
  const MarkOutcome plain = train<MarkedSmall>(false);
  const MarkOutcome marked = train<MarkedSmall>(true);
  const MarkOutcome noisy = train<recipes::MarkedForCompression<Base, Waves<float>>>(true);
  MESSAGE("bits: without ", plain.accuracy, " (", plain.psnr, " dB), marked ", marked.accuracy, " (", marked.psnr,
          " dB), with quantization noise ", noisy.accuracy, " (", noisy.psnr, " dB)");
  if (compmark::testing::short_trainings) return;
  CHECK(plain.accuracy < 0.9);  // negative control: this message is not what the scene says by itself
  // An accuracy is a mean of eighths over the views: every bit of every view was read if it is 1 but for the rounding of that sum.
  CHECK(marked.accuracy > 0.9999);
  CHECK(noisy.accuracy > 0.9999);
}

namespace {

/// The shipped embedder, its block under a name of one's own.
struct OwnResidual : ResidualFeature<float> {
  [[nodiscard]] static Handles add_parameters(ParameterArena<float>& arena, std::size_t rows, std::size_t columns) {
    return {arena.add("my.residual", rows, columns, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed())};
  }
};
struct OwnMarkedSmall : MarkedSmall {
  using Embedder = OwnResidual;
};

}  // namespace

TEST_CASE("embed/watermark: what a block is called decides nothing: an embedder of another name learns the same bits") {
  std::vector<float> shipped, own, unmarked;
  static_cast<void>(train<MarkedSmall>(true, &shipped));
  static_cast<void>(train<OwnMarkedSmall>(true, &own));
  static_cast<void>(train<MarkedSmall>(false, &unmarked));
  CHECK(own == shipped);
  CHECK(own != unmarked);  // negative control: the message is in these bits
}

TEST_CASE("embed/watermark: readings between the training views change the model, and the message is read") {
  std::vector<float> without, with;
  static_cast<void>(train<MarkedSmall>(true, &without, 2, 0));
  const MarkOutcome outcome = train<MarkedSmall>(true, &with, 2, 1);
  CHECK(without != with);
  if (!compmark::testing::short_trainings) CHECK(outcome.accuracy > 0.9999);
}

TEST_CASE("embed/watermark: a marked training has the same bits at any thread count") {
  std::vector<float> one, three;
  using R = recipes::MarkedForCompression<Base, Waves<float>>;
  static_cast<void>(train<R>(true, &one, 1, 2));
  static_cast<void>(train<R>(true, &three, 3, 2));
  REQUIRE(one.size() == three.size());
  CHECK(std::memcmp(one.data(), three.data(), one.size() * sizeof(float)) == 0);
}

TEST_CASE("embed/watermark: a finished model is marked by training on from it") {
  // The base recipe without a mark, then the same model with room for one.
  TrainSettings settings;
  settings.iterations = compmark::testing::short_trainings ? 20 : 200;
  settings.voxel_size = 0.05;
  settings.seed = 2;
  ThreadExecutor executor(2);
  BlobViews views;
  Trainer<Base, ThreadExecutor> first(settings, 6, 1.0, executor);
  REQUIRE(first.initialise(cloud(400, 7)));
  REQUIRE(first.run(views));

  settings.iterations = compmark::testing::short_trainings ? 20 : 400;
  settings.grow_until = 0;
  settings.mark.message.lambda = 0.05;
  settings.mark.message.after = 0;
  settings.mark.message.ramp = 0;
  settings.mark.hsv.after = 0;
  settings.mark.message.logit_scale = 1;
  Trainer<MarkedSmall, ThreadExecutor> second(settings, 6, 1.0, executor);
  set_watermark(second, Waves<float>{}, hidden_message);
  second.start_from(with_room_for_stages<MarkedSmall>(first.model(), settings.seed));
  CHECK(second.state().iteration == 0);
  // It starts as what it was started from, to the bit: the residual is zero.
  const Model<Base> room = baked_model(second.model());
  REQUIRE(room.arena.all_values().size() == first.model().arena.all_values().size());
  CHECK(std::memcmp(room.arena.all_values().data(), first.model().arena.all_values().data(),
                    room.arena.all_values().size() * sizeof(float)) == 0);
  REQUIRE(second.run(views));
  CHECK(second.model().anchor_count() == first.model().anchor_count());
  const auto matches = [&](const Model<Base>& base) {
    const Pipeline<Base> pipeline;
    Pipeline<Base>::Context context;
    std::vector<float> logits(8);
    std::size_t found = 0;
    for (std::size_t v = 0; v < views.size(); ++v) {
      static_cast<void>(pipeline.forward(base, views.camera(v), v, context, executor));
      Waves<float>::Context wave_context;
      Waves<float>{}.forward(context.image, logits, wave_context, executor);
      for (std::size_t i = 0; i < 8; ++i) found += (logits[i] > 0) == (hidden_message[i] == 1) ? 1 : 0;
    }
    return found;
  };
  if (compmark::testing::short_trainings) return;
  CHECK(matches(first.model()) < 8 * views.size());  // negative control
  CHECK(matches(baked_model(second.model())) == 8 * views.size());
}

namespace {

using compmark::testing::colours;
using ColourMarked = recipes::Marked<Base, LatticeDecoder<float>>;

}  // namespace

TEST_CASE("embed/watermark: a mark is learned in a finished model, which stays what it is to the bit") {
  TrainSettings settings;
  settings.iterations = compmark::testing::short_trainings ? 20 : 600;
  settings.voxel_size = 0.05;
  settings.seed = 2;
  settings.mark.message.after = settings.mark.residual.after = 6000;
  settings.mark.message.ramp = 0;
  settings.mark.message.logit_scale = 1;
  settings.mark.message.hinge_margin = 0.2;
  settings.mark.message.novel_view_every = 1;
  settings.mark.message.lambda = 1;
  settings.mark.residual.learning_rate = 0.02;
  settings.mark.residual.decay = 0.1;
  BlobViews views;
  const auto same = [](const Model<Base>& a, const Model<Base>& b) {
    const std::span<const float> x = a.arena.all_values(), y = b.arena.all_values();
    return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(float)) == 0;
  };
  ThreadExecutor executor(2);
  Trainer<Base, ThreadExecutor> plain(settings, 6, 1.0, executor);
  REQUIRE(plain.initialise(cloud(400, 7)));
  REQUIRE(plain.run(views));
  {  // the control: in the loss of the photographs the message moves the model too
    Trainer<ColourMarked, ThreadExecutor> joined(settings, 6, 1.0, executor);
    set_watermark(joined, colours(), hidden_message);
    REQUIRE(joined.initialise(cloud(400, 7)));
    REQUIRE(joined.run(views));
    CHECK(!same(base_model(joined.model()), plain.model()));
  }

  TrainSettings frozen = settings;
  frozen.mark.posthoc.fidelity = 60;
  frozen.mark.message.after = frozen.mark.residual.after = 0;
  using Embedding = PosthocEmbedding<ColourMarked, ThreadExecutor>;
  const auto finished_model = [&](const TrainSettings& chosen, double& distortion, std::size_t threads = 2) {
    ThreadExecutor own(threads);
    Embedding embedding(chosen, own);
    set_watermark(embedding, colours(), hidden_message);
    embedding.start_from(with_room_for_stages<ColourMarked>(plain.model(), settings.seed));
    REQUIRE(embedding.run(views));
    distortion = mark_report(embedding).distortion;
    return embedding.model();
  };
  double distortion = 0, loose_distortion = 0;
  const Model<ColourMarked> second = finished_model(frozen, distortion);
  CHECK(same(base_model(second), plain.model()));
  CHECK(!same(baked_model(second), plain.model()));
  double again = 0;
  CHECK(same(baked_model(finished_model(frozen, again, 1)), baked_model(second)));  // whatever the number of threads
  // A residual whose rate never begins stays zero.
  TrainSettings late = frozen;
  late.mark.residual.after = 30000;
  CHECK(same(baked_model(finished_model(late, again)), plain.model()));
  // An iteration that does not read looks at no view, and changes nothing.
  {
    TrainSettings seldom = frozen;
    seldom.mark.message.novel_view_every = 3;
    Embedding embedding(seldom, executor);
    set_watermark(embedding, colours(), hidden_message);
    embedding.start_from(with_room_for_stages<ColourMarked>(plain.model(), settings.seed));
    for (const bool reads : {false, false, true, false}) {
      const Model<Base> before = baked_model(embedding.model());
      const Result<IterationReport> report = embedding.step(views);
      REQUIRE(report.ok());
      CHECK(report->rendered == reads);
      CHECK((report->forward.gaussians > 0) == reads);
      CHECK(same(baked_model(embedding.model()), before) == !reads);
    }
  }
  // Cameras drawn by what the message cost there: another run, whose state is in its checkpoint.
  TrainSettings by_cost = frozen;
  by_cost.mark.posthoc.draw_by_cost = 1;
  double by_cost_distortion = 0;
  const Model<ColourMarked> straight = finished_model(by_cost, by_cost_distortion);
  CHECK(same(base_model(straight), plain.model()));
  // Of 20 iterations the costs of six views differ too little to change a draw.
  if (!compmark::testing::short_trainings) CHECK(!same(baked_model(straight), baked_model(second)));
  {
    const auto begun = [&] {
      Embedding embedding(by_cost, executor);
      set_watermark(embedding, colours(), hidden_message);
      embedding.start_from(with_room_for_stages<ColourMarked>(plain.model(), settings.seed));
      return embedding;
    };
    auto stopped = begun();
    REQUIRE(stopped.step(views).ok());  // the first is what was read there, of the view that was drawn
    const std::vector<double>& first = stopped.state().costs.mean;
    CHECK(std::count_if(first.begin(), first.end(), [](double cost) { return cost >= 0; }) == 1);
    CHECK(*std::max_element(first.begin(), first.end()) == mark_report(stopped).message);
    while (stopped.state().iteration < by_cost.iterations / 2) REQUIRE(stopped.step(views).ok());
    CHECK(stopped.state().costs.mean.size() == views.size());
    ModelInfo info;
    info.recipe = "small";
    for (std::size_t i = 0; i < views.size(); ++i)
      info.views.push_back({std::to_string(i), false, views.camera(i), {}});
    const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark-costs-test.safetensors";
    REQUIRE(write_checkpoint(path, stopped.state(), by_cost, info, 0).ok());
    auto loaded = read_checkpoint<Embedding>(path, by_cost, info);
    REQUIRE(loaded.ok());
    auto resumed = begun();
    resumed.restore(std::move(loaded->state));
    REQUIRE(resumed.run(views));
    CHECK(same(baked_model(resumed.model()), baked_model(straight)));
    // Others than a view each, or a number that is none: refused by name.
    const auto refused = [&](std::vector<double> costs) {
      auto state = stopped.state();
      state.costs.mean = std::move(costs);
      REQUIRE(write_checkpoint(path, state, by_cost, info, 0).ok());
      const auto found = read_checkpoint<Embedding>(path, by_cost, info);
      return !found.ok() && found.error().field == "mark.view_costs";
    };
    CHECK_FALSE(refused({}));  // stopped before anything was read
    CHECK(refused({1, 2, 3}));
    CHECK(refused(std::vector<double>(views.size(), std::numeric_limits<double>::quiet_NaN())));
    CHECK_FALSE(refused(stopped.state().costs.mean));
    std::filesystem::remove(path);
  }
  frozen.mark.posthoc.fidelity /= 100;  // held a hundredth as much
  const Model<ColourMarked> loose = finished_model(frozen, loose_distortion);
  CHECK(distortion > 0);
  CHECK(loose_distortion > distortion);

  // Read from the views between the training views, where it was learned, and held to the unmarked renders there.
  const auto read = [&](const Model<Base>& base, double& distortion_db) {
    const Pipeline<Base> pipeline;
    Pipeline<Base>::Context context, unmarked;
    std::vector<float> logits(8);
    std::size_t found = 0;
    double square = 0;
    constexpr std::size_t count = 20;
    for (std::size_t i = 0; i < count; ++i) {
      const Random random(77, i, random_stage("between"));
      const Camera<double> camera =
          novel_view_camera([&](std::size_t v) { return views.camera(v); }, views.size(), i % views.size(), random);
      static_cast<void>(pipeline.forward(base, camera, unseen_view, context, executor));
      static_cast<void>(pipeline.forward(plain.model(), camera, unseen_view, unmarked, executor));
      for (std::size_t p = 0; p < context.image.size(); ++p) {
        square += std::pow(static_cast<double>(context.image.data[p]) - static_cast<double>(unmarked.image.data[p]), 2);
      }
      LatticeDecoder<float>::Context colour_context;
      colours().forward(context.image, logits, colour_context, executor);
      for (std::size_t b = 0; b < 8; ++b) found += (logits[b] > 0) == (hidden_message[b] == 1) ? 1 : 0;
    }
    distortion_db = -10 * std::log10(square / static_cast<double>(count * context.image.size()));
    return static_cast<double>(found) / (8 * count);
  };
  double none = 0, finished_db = 0, loose_db = 0;
  const double before = read(plain.model(), none);
  const double finished = read(baked_model(second), finished_db);
  static_cast<void>(read(baked_model(loose), loose_db));
  MESSAGE("bits between the views: unmarked ", before, ", marked ", finished, " at ", finished_db, " dB; held less ",
          loose_db, " dB");
  if (compmark::testing::short_trainings) return;
  CHECK(finished_db > 31);  // measured 32.7 and 24.2 dB, at -O1 and at -O3
  CHECK(loose_db < finished_db - 3);
  CHECK(finished > before + 0.15);
}

TEST_CASE("embed/watermark: the gradient of the distortion against the unmarked render equals central differences") {
  using R = recipes::Marked<SmoothRecipe, Waves<double>>;
  Model<R> model = compmark::testing::random_model<R>(24);
  const Random residual(8, 0, random_stage("test residual"));
  const MatrixView<double> values = model.arena.values(model.arena.layout().find("anchor.residual"));
  for (std::size_t i = 0; i < values.size(); ++i) values.data[i] = 0.3 * residual.normal(i);
  const Camera<double> camera = ring_camera(1, 5, 37, 29);
  Buffer<double> unmarked_storage(3 * 37 * 29);
  const Random random(5, 0, random_stage("test target"));
  for (std::size_t i = 0; i < unmarked_storage.size(); ++i) unmarked_storage[i] = random.uniform(i);
  const ImageView<const double> unmarked{unmarked_storage.data(), 3, 29, 37};
  Pipeline<R> pipeline;
  pipeline.template stage<MessageStage>().message = hidden_message;
  pipeline.template stage<MessageStage>().message_loss.settings.logit_scale = 1;
  typename Pipeline<R>::Phases phases;
  phases.template of<MessageStage>().weight = 0.5;
  SerialExecutor executor;
  using Context = typename Pipeline<R>::Context;
  compmark::testing::check_directional_derivative(
      model,
      [&](Context& context) {
        static_cast<void>(pipeline.forward(model, camera, 1, context, executor, phases));
        return message_loss(pipeline, 20.0, unmarked, context, executor).total;
      },
      [&](Context& context) { pipeline.backward(model, camera, 1, context, executor); });
}
