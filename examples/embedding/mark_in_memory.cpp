// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// CompMark inside another program. It has images in memory, threads of its own, and a recipe of five policies; one of
// them, the message decoder, is written here. An observer shows the progress. At the end it proves that the message is
// there, and that another key's is not. No file is read or written.
#include <compmark/compmark.hpp>

#include <array>
#include <atomic>
#include <barrier>
#include <cstdio>
#include <exception>
#include <functional>
#include <thread>
#include <vector>

namespace {

using namespace compmark;

// 1. Threads: whatever runs for_chunks is an executor. This one is a team that meets at a barrier.
class Team {
 public:
  explicit Team(std::size_t workers) : meet_(static_cast<std::ptrdiff_t>(workers)), workers_(workers) {
    for (std::size_t worker = 1; worker < workers; ++worker) {
      threads_.emplace_back([this, worker] {
        while (true) {
          meet_.arrive_and_wait();
          if (stop_) return;
          work(worker);
          meet_.arrive_and_wait();
        }
      });
    }
  }
  ~Team() {
    stop_ = true;
    meet_.arrive_and_wait();
    for (std::thread& thread : threads_) thread.join();
  }
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  [[nodiscard]] std::size_t concurrency() const { return workers_; }
  /// Chunks depend on n and grain alone, so results do not depend on the number of workers.
  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    if (n == 0) return;
    body_ = [&](std::size_t begin, std::size_t worker) { body(begin, begin + grain < n ? begin + grain : n, worker); };
    size_ = n;
    grain_ = grain;
    next_ = 0;
    failed_.clear();
    failure_ = nullptr;
    meet_.arrive_and_wait();
    work(0);
    meet_.arrive_and_wait();
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  void work(std::size_t worker) {
    try {
      for (std::size_t begin = 0; (begin = next_.fetch_add(grain_)) < size_;) body_(begin, worker);
    } catch (...) {
      if (!failed_.test_and_set()) failure_ = std::current_exception();  // of the first who fails
    }
  }

  std::barrier<> meet_;
  std::size_t workers_, size_ = 0, grain_ = 1;
  std::function<void(std::size_t, std::size_t)> body_;
  std::atomic<std::size_t> next_ = 0;
  std::atomic_flag failed_;
  std::exception_ptr failure_;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};
static_assert(Executor<Team>);

// 2. Images: whatever says how many views there are, where their cameras stand and what they saw.
struct Memory {
  std::vector<Camera<double>> cameras;
  std::vector<std::vector<float>> images;  // [3, height, width] in [0, 1]

  [[nodiscard]] std::size_t size() const { return cameras.size(); }
  [[nodiscard]] Camera<double> camera(std::size_t i) const { return cameras[i]; }
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<float> image) const {
    std::copy(images[i].begin(), images[i].end(), image.data);
    return Done{};
  }
};
constexpr int side = 64;

Memory photographs(int count, Team& team) {
  ProceduralSettings settings;
  settings.width = settings.height = side;
  settings.views_train = count;
  const ProceduralScene scene;
  Memory memory;
  for (int i = 0; i < count; ++i) {
    const Camera<double> camera = procedural_camera(settings, Split::train, i);
    const ImageBytes bytes = render_procedural(scene, camera, team);
    std::vector<float> planes(3 * side * side);
    for (std::size_t p = 0; p < side * side; ++p) {
      for (std::size_t c = 0; c < 3; ++c)  // over black
        planes[c * side * side + p] = static_cast<float>(bytes.pixels[4 * p + c] * bytes.pixels[4 * p + 3] / 65025.0);
    }
    memory.cameras.push_back(camera);
    memory.images.push_back(std::move(planes));
  }
  return memory;
}

// 3. A message decoder: bit i is the sign of the image's correlation with wave i. The waves' directions, lengths and
// phases are the key's secret.
struct SecretWaves {
  using Scalar = float;
  struct Context {};
  static constexpr int count = 32;
  static constexpr float gain = 1600;
  std::vector<float> wave;  // [count, 3, side, side]

  SecretWaves() = default;
  explicit SecretWaves(const OwnerKey& key) {
    const std::array<std::uint64_t, 4> seed = carrier_seed(key);
    for (std::uint64_t bit = 0; bit < count; ++bit) {
      const Random random(seed[bit % 4], bit, random_stage("secret waves"));
      const double angle = 3.1415926535 * random.uniform(0), turns = 6 + 8 * random.uniform(1);
      for (int c = 0; c < 3; ++c) {
        const double phase = 6.2831853072 * random.uniform(static_cast<std::uint64_t>(2 + c));
        for (int y = 0; y < side; ++y) {
          for (int x = 0; x < side; ++x) {
            const double along = (x * std::cos(angle) + y * std::sin(angle)) / side;
            wave.push_back(static_cast<float>(std::sin(6.2831853072 * turns * along + phase)));
          }
        }
      }
    }
  }
  [[nodiscard]] static constexpr int bits() { return count; }
  [[nodiscard]] static constexpr int minimum_size() { return side; }

  template <Executor E>
  void forward(ImageView<const float> image, std::span<float> logits, Context&, E&) const {
    const std::size_t n = image.size();
    for (std::size_t bit = 0; bit < count; ++bit) {
      double sum = 0;
      for (std::size_t i = 0; i < n; ++i) sum += static_cast<double>(wave[bit * n + i]) * image.data[i];
      logits[bit] = static_cast<float>(gain * sum / static_cast<double>(n));
    }
  }
  template <Executor E>
  void backward(std::span<const float> d_logits, ImageView<float> d_image, Context&, E&) const {
    const std::size_t n = d_image.size();
    for (std::size_t bit = 0; bit < count; ++bit) {
      const float slope = d_logits[bit] * gain / static_cast<float>(n);
      for (std::size_t i = 0; i < n; ++i) d_image.data[i] += slope * wave[bit * n + i];
    }
  }
};

// 4. A recipe: five policies by position, and what carries the mark. Base is what a file of the finished model
// holds.
constexpr DecoderShape shape{.feature_dim = 16, .offsets = 5};
using Anchors = ScaffoldAnchors<float, shape>;
using Raster = TrainingRasterizer<float, accuracy::fast>;
struct MyRecipe : Policies<Anchors, Raster, QuantizationNoise<float, 16>, AdaptiveQuantizer<float>, SecretWaves> {
  using Base = Policies<Anchors, Raster>;
  using Embedder = ResidualFeature<float>;
};

// 5. Progress: an observer sees every iteration and may stop the run.
struct Progress {
  template <class Trainer>
  bool on_iteration(const Trainer&, const IterationReport& report) const {
    if (report.iteration % 200 == 0) {
      std::printf("iteration %4lld of %lld: loss %.4f, %zu anchors\n", static_cast<long long>(report.iteration),
                  static_cast<long long>(report.total), report.loss.total, report.anchors);
    }
    return true;
  }
};

/// Reads the message of a key from the renders of a model, as whoever checks a claim does.
Result<Verification> verify(const Model<MyRecipe::Base>& model, const Memory& views, const OwnerKey& key, Team& team) {
  const SecretWaves decoder(key);
  const Pipeline<MyRecipe::Base> pipeline;
  Pipeline<MyRecipe::Base>::Context context;
  SecretWaves::Context none;
  std::vector<ViewLogits> read;
  std::vector<float> logits(SecretWaves::count);
  for (std::size_t i = 0; i < views.size(); ++i) {
    (void)pipeline.forward(model, views.camera(i), i, context, team);
    round_to_8bit<float>(context.image, context.image);  // what a screenshot holds
    decoder.forward(context.image, logits, none, team);
    read.push_back({"view " + std::to_string(i), "", {logits.begin(), logits.end()}});
  }
  return verify_message(message_of(key), read);
}

int fail(const Error& error) {
  std::fprintf(stderr, "%s\n", error.line().c_str());
  return 1;
}

}  // namespace

int main() {
  Team team(2);
  const Memory views = photographs(12, team);

  // A real key comes from os_random and make_key and is kept in a file; these two make the example the same everywhere.
  OwnerKey key, other;
  for (std::size_t i = 0; i < key.secret.size(); ++i) {
    key.secret[i] = static_cast<std::byte>(7 * i + 1);
    other.secret[i] = static_cast<std::byte>(11 * i + 2);
  }
  key.bits = other.bits = SecretWaves::count;

  TrainSettings settings;
  settings.iterations = 1500;
  settings.voxel_size = 0.02;
  settings.mark.message.logit_scale = 1;
  settings.mark.message.lambda = 0.03;
  settings.mark.message.after = 6000;  // of 30,000: windows scale with the number of iterations
  settings.mark.message.ramp = 3000;
  Trainer<MyRecipe, Team> trainer(settings, views.size(), 3.8, team);
  const Message message = message_of(key);
  std::vector<std::uint8_t> bits;
  for (std::size_t i = 0; i < message.size(); ++i) bits.push_back(message[i] ? 1 : 0);
  set_watermark(trainer, SecretWaves(key), bits);
  std::vector<std::array<float, 3>> points;  // to start from: anything within the scene
  const Random random(1, 0, random_stage("points"));
  for (std::uint64_t i = 0; i < 4000; ++i) {
    points.push_back({});
    for (std::uint64_t axis = 0; axis < 3; ++axis)
      points.back()[axis] = static_cast<float>(2.4 * random.centered(3 * i + axis));
  }
  if (const auto ready = trainer.initialise(points); !ready) return fail(ready.error());
  Memory source = views;
  if (const auto done = trainer.run(source, Progress{}); !done) return fail(done.error());

  const Model<MyRecipe::Base> model = baked_model(trainer.model());
  const auto mine = verify(model, views, key, team), theirs = verify(model, views, other, team);
  if (!mine) return fail(mine.error());
  if (!theirs) return fail(theirs.error());
  std::printf("this key:    %zu of %zu bits, p = %.2g\n", mine->evidence.matches, mine->bits, mine->evidence.p_value);
  std::printf("another key: %zu of %zu bits, p = %.2g\n", theirs->evidence.matches, theirs->bits,
              theirs->evidence.p_value);
  return mine->verdict == Verdict::detected && theirs->verdict == Verdict::not_detected ? 0 : 1;
}
